"""Families of problems with generators, one file each, named by FAMILIES: functions of numbers and
texts, with a seed where random numbers are drawn, that return an InterfaceProblem.
"""
