"""The numerical algorithms that several methods share: Newton and Krylov steps, projections with
balance, splittings.
"""
