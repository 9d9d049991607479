"""What is read off a solved scene: edges, peaks, resultants, stresses at places, fields on the
surfaces.
"""
