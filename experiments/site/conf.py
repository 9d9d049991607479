"""Sphinx configuration. Build: python -m sphinx -W --keep-going -b html experiments/site out/site

MyST-NB reads the tutorials as they are, percent scripts through jupytext, executes them and renders
their Markdown like that of every other page. So one file is script, test, notebook and page;
sphinx-gallery would need its text in reStructuredText, and would not make a notebook that Jupyter
and VS Code open from the same file. MathJax comes with sphinx-mathjax-offline: pages load nothing
from elsewhere, neither when they are built nor when they are read.
"""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parent))
import docstrings
import generate
import lectures
import museum

import contactopt

# the chapters, which run in processes of their own, import the exercises of the course
os.environ["PYTHONPATH"] = os.pathsep.join([sys.path[1], os.environ.get("PYTHONPATH", "")])
project, author = "contactopt", "The contactopt developers"
copyright = author
version = release = contactopt.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx-mathjax-offline"]
exclude_patterns = [
    "*.py",
    "notes",
    "openings",
    "accuracy.md",
    "performance.md",
    "course.md",
    "museum.md",
    "lecturers.md",
    "museum/*",
    "lectures/*",
    "generated/notebooks",
    "**/__pycache__",
]
html_theme, html_title = "furo", f"contactopt {version}"
html_static_path, html_css_files = ["_static"], ["site.css"]
html_search_scorer = str(Path(__file__).parent / "search.js")
html_show_sourcelink, html_copy_source = False, False

myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode, nb_execution_timeout = "force", 180
# a second run of the chapters; the tests execute the solutions
nb_execution_excludepatterns = ["**/solutions_*"]
nb_execution_raise_on_error, nb_execution_in_temp, nb_merge_streams = True, True, True

autodoc_member_order, autodoc_typehints = "bysource", "signature"
autodoc_default_options = {"members": True}
maximum_signature_line_length = 100


def write_lectures(app, error):
    """Write the slides, from the notebooks that MyST-NB has executed."""
    notebooks = Path(app.outdir).parent / "jupyter_execute" / "generated"
    if error is None and app.config.nb_execution_mode != "off":  # else no notebook has figures
        lectures.write(notebooks, Path(app.outdir) / "lectures")


def setup(app):
    """Register the reader of docstrings, and write the pages that are made from tables."""
    app.connect(
        "autodoc-process-docstring",
        lambda app, what, name, thing, options, lines: docstrings.as_rst(lines),
    )
    app.connect(
        "autodoc-process-signature",
        lambda app, what, name, thing, options, signature, returns: (
            (signature or "").replace("<factory>", "...") or None,
            returns,
        ),
    )
    app.connect("builder-inited", lambda app: generate.write_pages(Path(app.srcdir)))
    app.connect("build-finished", lambda app, error: museum.write(Path(app.outdir) / "museum"))
    app.connect("build-finished", write_lectures)
    return {"parallel_read_safe": True}
