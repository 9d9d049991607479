"""How accurate are the answers, and what does accuracy cost? Run with `python -m
experiments.questions.accuracy`.
"""
