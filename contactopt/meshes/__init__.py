"""Meshes are read from files, repaired, made by structure, refined everywhere or in places."""
