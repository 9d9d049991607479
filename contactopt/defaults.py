"""What holds where nothing else is asked for; read by words and numbers alike."""

TOL = 1e-8  # largest natural-map residual that counts as solved
