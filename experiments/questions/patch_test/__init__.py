"""Random pairs of surfaces of every kind, each asked for a constant pressure."""
