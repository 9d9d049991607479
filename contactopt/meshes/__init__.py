"""Meshes: read from files, repaired, made by structure, refined everywhere or where it is needed."""
