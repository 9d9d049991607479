"""Every key of an experiment file with an example, as the help of `contactopt bench` and the
documentation show them.
"""

from __future__ import annotations

# key -> (what it says, an example of its value)
EXPERIMENT = {
    "name": ("the name of the experiment and of the folder of its results", '"friction"'),
    "title": ("the title of the report", '"Friction on two scenes"'),
    "text": ("the report's first paragraph", '"Two scenes, three methods."'),
    "plugins": ("files beside this one with methods and problems of your own", '["mine.py"]'),
    "settings": ("the tolerances: default (1e-8), low (1e-3), mid (1e-6), high (1e-9), or numbers", '["low", "mid", 1e-7]'),
    "starts": ("cold: from nothing; warm: from the solution at nine tenths of load and friction", '["cold", "warm"]'),
    "repeats": ("how often each run is made", "3"),
    "time_limit": ("seconds of wall time after which a run is ended", "10.0"),
    "memory_limit": ("gigabytes of data above which a run is ended", "4.0"),
    "max_iterations": ("largest number of outer iterations of a method", "20000"),
    "seed": ("seed of the random numbers, set before each run", "0"),
    "diagnose": ("whether rank and condition number of Q and thresholds of friction are computed for each problem", "true"),
    "problems": ("tables [[problems]]: each names a scene, an fclib file or a family of problems, and gives its arguments as numbers, lists or ranges", '[{scene = "punch-2d", mu = {from = 0.1, to = 1.0, steps = 3, scale = "log"}}]'),
    "methods": ("tables [[methods]]: each names a method or several, and gives their settings as values or lists; optional = true: left out where not installed", '[{method = ["auto", "nsgs"]}]'),
    "quick": ("other values of keys for `contactopt report --run quick`", '{settings = ["mid"]}'),
    "figures": ("tables [[figures]]: the figures and tables of the report; without this key it has the usual ones", '[{kind = "success_table", caption = "All runs."}]'),
    "findings": ("a Python file beside this one; its function findings(table) returns sentences for the report", '"mine_findings.py"'),
    "columns": ("columns of the small table that is kept with the report (default: nearly all)", '["method", "residual"]'),
}  # fmt: skip
FIGURE = {
    "kind": ("what is drawn or tabulated, see below", '"speed_accuracy"'),
    "caption": ("the text below the figure", '"Time against accuracy."'),
    "where": ("which rows are drawn: a value or a list of values for each column; law = coulomb unless given", '{setting = "mid", family = ["punch-2d"]}'),
    "optional": ("true: the figure is left out where no row fits", "true"),
    "by": ("the column that gives each line, panel or row its name", '"method"'),
    "labels": ("short names for long ones", '{"normal_qp(backend=\'osqp\')" = "osqp"}'),
    "time": ("for speed_accuracy: the column of times", '"cpu_seconds"'),
    "metric": ("the column of times, or of another cost", '"cpu_seconds"'),
    "size": ("for time_against_size: the column of sizes", '"contacts"'),
    "x": ("for stability_map: the column drawn across; for convergence: iterations or seconds", '"problem.mu"'),
    "y": ("for stability_map: the column drawn upwards", '"problem.elements"'),
    "value": ("for stability_map: what is coloured: success, iterations, residual, error or a column of times", '"iterations"'),
    "across": ("for tables: the column whose values stand side by side", '"setting"'),
}  # fmt: skip
KINDS = {
    "speed_accuracy": (
        "time against certified residual, one line for each method: what does accuracy cost?"
    ),
    "performance_profile": (
        "share of the problems solved within a factor of the best time: which method fails, which"
        " is fast?"
    ),
    "time_against_size": (
        "time against size, with the exponent of growth: which method is fit for large problems?"
    ),
    "stability_map": "success, iterations or error over two parameters: where does a method fail?",
    "convergence": (
        "residual after each iteration of single runs: how does a method reach its answer?"
    ),
    "success_table": "percent of the runs that kept the tolerance: how did the others end?",
    "time_table": (
        "mean times, in which a failure counts as the time limit: what does a warm start save"
        " (across = start)?"
    ),
}


def help_text() -> str:
    """Write every key of an experiment file as plain text, with an example each.

    Returns
    -------
    The text, one line or two for each key.
    """
    lines = ["keys of an experiment file, with an example each:"]
    lines += [
        f"  {key:16} {what}\n{'':19}{key} = {example}"
        for key, (what, example) in EXPERIMENT.items()
    ]
    lines += ["", "keys of a table [[figures]]; those from `by` on belong to some kinds only:"]
    lines += [
        f"  {key:16} {what}\n{'':19}{key} = {example}" for key, (what, example) in FIGURE.items()
    ]
    lines += ["", "kinds of figures and tables, and the question that each answers:"]
    return "\n".join(lines + [f"  {kind:20} {what}" for kind, what in KINDS.items()])
