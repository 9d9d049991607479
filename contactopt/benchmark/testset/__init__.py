"""The test set of contactopt: problems with a name, a version, tags and reference answers.

A set is a TOML file. Its tables `[[problems]]` are those of an experiment file with the key `tier`
besides: small (a good method needs less than 0.3 s), medium, large (more than 3 s). The JSON file
of the same name beside it holds what was computed of each problem: its tags and its reference
answer. Set 1 is `set_1.toml` here. A set of yours names files of FCLib or of Siconos in one line,
`fclib = "folder/*.dat"`, or families of contactopt.benchmark.families.

    >>> from contactopt.benchmark import testset
    >>> for problem in testset.problems("small", ["dim=3", "contacts<100"]):
    ...     answer = contactopt.solve(problem.load())

An experiment file takes problems of a set by `[[problems]]`, `testset = "1"`, `tier = "small"`.
"""

from contactopt.benchmark.testset.problem_set import TIERS, Problem, problems
from contactopt.benchmark.testset.tags import TAGS, tags_of

__all__ = ["TAGS", "TIERS", "Problem", "problems", "tags_of"]
