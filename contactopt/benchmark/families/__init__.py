"""Families of problems with generators, one file each. Their table is FAMILIES in
contactopt.benchmark.problems.

A family is a function whose arguments are numbers and texts, with a seed where it draws random
numbers, and which returns an InterfaceProblem. `[[problems]] family = NAME` of an experiment file
and of a test set makes its problems.
"""
