"""Meshes that do not match: exactness and accuracy."""
