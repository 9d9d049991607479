"""Idioms that were translated from another language, and that the field does not use."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
CALQUES = (
    r"\blets? (?:one |us |you )?expect\b", r"\b(?:is|are) told (?:before|beforehand)\b",
    r"\b(?:solver|code|peer|method)s? of others\b", r"\bstraight between (?:two|them|these)\b",
    r"\bdrawn anew\b", r"\bprograms? of others\b", r"\bask it before\b", r"\btimes the least of\b",
    r"\bof a load path (?:it|this|the deck) (?:is|has)\b", r"\bfrom here on (?:it|the|some)\b",
    r"\b(?:PDF|picture) is what your\b", r"\btest that holds (?:it|this)\b",
    r"\bno usable answer\b", r"\bcorresponding form of\b", r"\bdirections are nearly parallel\b",
    r"\basked for a certificate of\b", r"\bcomes? near it\b.{0,20}\bmesh\b",
    r"\bsmaller than [\d.]+, but for\b", r"\bnothing with a mesh\b", r"\bis dear\b",
    r"\btells? parameters\b", r"\bwhat (?:it|that|one|each) is worth\b",
    r"\bmakes? (?:it|this) to a\b", r"\bso long until\b", r"\bin the meaning of\b",
    r"\bunder the condition that\b", r"\bone speaks of\b", r"\bthe one after the other\b",
    r"\bis in the position to\b", r"\bcomes into question\b", r"\bto the contrary of\b",
    r"\bstands? to choice\b",
    r"\b(?:derivative|gradient)s? by (?:the|its|all|an?|loads|these|some)\b(?! nodal)",
    r"\bin (?:its|the) head of this\b", r"\bunits in its head\b", r"\bsomething else than\b",
    r"\bwhat (?:it )?spoils it\b", r"\bfor a strong one\b",
    r"\btwo like (?:bodies|cylinders|spheres)\b", r"\bwhat the forces move\b",
    r"\bstands? for what is usual\b", r"\bsolvers? knows? no\b", r"\bunit\S* says? it of\b",
    r"\b(?:contacts?|problems?) in the space\b", r"\b(?:set|file|mesh|solver)s? of yours\b",
    r"\bstands? at the head of\b", r"\bnumbered from \d+ on\b",
    r"\bis of the order of the elements\b", r"\b(?:large|long|small) beside (?:its|the|their)\b",
    r"\bsolvers? that others wrote\b", r"\btold before it\b",
    r"\bpass(?:es)? a constant pressure on\b", r"\bthe way matters\b", r"\bdivide the way\b",
    r"\bby as much, in shares\b", r"\b(?:bound|deck|FCLib) knows\b",
    r"\botherwise than expected\b", r"\bfrom the least on\b", r"\bat a certificate of\b",
    r"\bknows? more of\b", r"\bmap leads out\b", r"\berror is taken off\b",
    r"\bdecides? nothing alone\b",
    r"\b(?:made?|built|begins?|start(?:s|ed)|measured?|draw|search|place) anew\b",
    r"\bof the head(?: of|\.)", r"\bmodule's head\b", r"\bby little\b", r"\bis one of the plane\b",
    r"\bthe head of (?:this module|contactopt)", r"\bover (?:itself|themselves)\b",
    r"\barguments as of\b", r'(?-i:(?:"""|[a-z)]\. )Of (?!course)[a-z])',
)  # fmt: skip
FOLDERS = ("contactopt", "experiments")
KINDS = {".py", ".md", ".toml", ".js", ".html"}
QUOTED = re.compile(r"^\| not \| but \|\n(?:\|.*\n)*", re.M)  # examples of CONTRIBUTING.md


def texts():
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "reports/README.md"):
        yield ROOT / name
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in KINDS and "generated" not in path.parts:
                yield path


ANY = re.compile("|".join(CALQUES), re.I)


def found(text):
    text = re.sub(r"\n\s*(?:#\s+)?|\"\s*f?\"", " ", QUOTED.sub("", text))  # over ends of lines
    return ANY.findall(text)


def test_no_calque_has_come_back():
    paths = list(texts())
    assert len(paths) > 300
    wrong = {str(path.relative_to(ROOT)): found(path.read_text()) for path in paths}
    assert not any(wrong.values()), {name: words for name, words in wrong.items() if words}


def test_the_list_finds_a_calque_over_the_end_of_a_line():
    assert found("# the error that this one mesh lets\n# expect") == ["lets expect"]
    assert found("a solver of\nothers") and not found("an external solver")
    assert found("| not | but |\n|---|---|\n| lets expect | x |\n") == []
