"""Does CalculiX find the same contact forces on the same mesh? Run with `python -m
experiments.questions.calculix`.
"""
