"""What is read off a solved scene: edges, peaks, resultants, stresses and fields."""
