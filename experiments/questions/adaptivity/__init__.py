"""How many unknowns does an accuracy need? Run with `python -m experiments.questions.adaptivity`."""
