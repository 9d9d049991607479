"""Every key of an experiment file with an example, as the help of `contactopt bench` and the documentation show them."""

from __future__ import annotations

# key -> (what it says, an example of its value)
EXPERIMENT = {
    "name": ("names the folder of the results", '"friction"'),
    "title": ("the head of the report", '"Friction on two scenes"'),
    "text": ("the report's first paragraph", '"Two scenes, three methods."'),
    "plugins": ("files beside this one with methods and problems of your own", '["mine.py"]'),
    "settings": ("bounds on the certificate: default (1e-8), low (1e-3), mid (1e-6), high (1e-9), or numbers", '["low", "mid", 1e-7]'),
    "starts": ("cold, or warm from the solution at nine tenths of load and friction", '["cold", "warm"]'),
    "repeats": ("how often each run is made", "3"),
    "time_limit": ("seconds of wall time per run, enforced", "10.0"),
    "memory_limit": ("GB of data per run, enforced", "4.0"),
    "max_iterations": ("outer iterations that a method may take", "20000"),
    "seed": ("of the random numbers before each run", "0"),
    "diagnose": ("whether rank, condition and thresholds of friction are computed for each problem", "true"),
    "problems": ("tables [[problems]] with scene, fclib or family, its arguments as numbers, lists or ranges, and optional", '[{scene = "punch-2d", mu = {from = 0.1, to = 1.0, steps = 3, scale = "log"}}]'),
    "methods": ("tables [[methods]] with method, its settings as values or lists, and optional", '[{method = ["auto", "nsgs"]}]'),
    "quick": ("keys that the quick version replaces", '{settings = ["mid"]}'),
    "figures": ("tables [[figures]], of which the report is made; without any it has the usual ones", '[{kind = "success_table", caption = "All runs."}]'),
    "findings": ("a Python file beside this one whose findings(table) returns sentences for the report", '"mine_findings.py"'),
    "columns": ("columns of the small table that is kept with the report; all but a few by default", '["method", "residual"]'),
}  # fmt: skip
FIGURE = {
    "kind": ("what is drawn or tabulated, see below", '"speed_accuracy"'),
    "caption": ("the text below it", '"Time against accuracy."'),
    "where": ("the rows it takes: column and value, or a list of values; law = coulomb unless given", '{setting = "mid", family = ["punch-2d"]}'),
    "optional": ("whether it is left out where no row fits", "true"),
    "by": ("the column that tells the lines, panels or rows apart", '"method"'),
    "labels": ("short names for long ones", '{"normal_qp(backend=\'osqp\')" = "osqp"}'),
    "time": ("of speed_accuracy: the column of times", '"cpu_seconds"'),
    "metric": ("the column of times, or of another cost", '"cpu_seconds"'),
    "size": ("of time_against_size: the column of sizes", '"contacts"'),
    "x": ("of stability_map: the column across; of convergence: iterations or seconds", '"problem.mu"'),
    "y": ("of stability_map: the column upwards", '"problem.elements"'),
    "value": ("of stability_map: success, iterations, residual, error or a column of times", '"iterations"'),
    "across": ("of tables: the column whose values stand side by side", '"setting"'),
}  # fmt: skip
KINDS = {
    "speed_accuracy": "time against certified residual, a line per method: what does accuracy cost?",
    "performance_profile": "share of the instances solved within a factor of the best time: which method fails, which is fast?",
    "time_against_size": "time against size with the exponent of growth: which method scales?",
    "stability_map": "success, iterations or error over two parameters: where does a method fail?",
    "convergence": "residual after each iteration of single runs: how does a method get there?",
    "success_table": "percent of the runs that kept the tolerance, and how the others ended",
    "time_table": "mean times with failures counted at the limit: what do warm starts buy (across = start)?",
}


def help_text() -> str:
    """Write every key of an experiment file as plain text, with an example each.

    Returns
    -------
    str
        The text, one line or two for each key.
    """
    lines = ["keys of an experiment file, with an example each:"]
    lines += [f"  {key:16} {what}\n{'':19}{key} = {example}" for key, (what, example) in EXPERIMENT.items()]
    lines += ["", "keys of a table [[figures]]; from `by` on they belong to some kinds only:"]
    lines += [f"  {key:16} {what}\n{'':19}{key} = {example}" for key, (what, example) in FIGURE.items()]
    lines += ["", "kinds of figures and tables, and the question that each answers:"]
    return "\n".join(lines + [f"  {kind:20} {what}" for kind, what in KINDS.items()])
