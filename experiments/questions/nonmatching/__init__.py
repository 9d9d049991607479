"""Meshes that do not match: exactness, accuracy, cost, and CalculiX beside."""
