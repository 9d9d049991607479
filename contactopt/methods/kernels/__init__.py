"""Numerical algorithms that several methods share."""
