"""The test set of contactopt: problems with a name, a version, tags and reference answers.

A set is a TOML file. Its tables `[[problems]]` are those of an experiment file with the key `tier`
besides: small (a good method needs less than 0.3 s), medium, large (more than 3 s). The JSON file
of the same name beside it holds what was computed of each problem: its tags and its reference
answer. Sets 1 and 2 are `set_1.toml` and `set_2.toml` here. Set 2 has sequences, whose `load` gives
a contactopt.benchmark.sequences.Sequence. Your own set names files of FCLib or of Siconos in one
line, `fclib = "folder/*.dat"`, or families of contactopt.benchmark.families.

    >>> from contactopt.benchmark import testset
    >>> for problem in testset.problems("small", ["dim=3", "contacts<100", "states=1"]):
    ...     answer = contactopt.solve(problem.load())

An experiment file takes problems of a set by `[[problems]]`, `testset = "2"`, `tier = "small"`.
"""

from contactopt.benchmark.testset.problem_set import NEWEST, SETS, TIERS, Problem, problems
from contactopt.benchmark.testset.tags import TAGS, tags_of

__all__ = ["NEWEST", "SETS", "TAGS", "TIERS", "Problem", "problems", "tags_of"]
