"""Bridges to other codes: each assembles the same block, and hands over its stiffness."""
