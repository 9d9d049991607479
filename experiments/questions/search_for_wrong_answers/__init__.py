"""Two ways to one answer, which share neither mesh nor coupling, for many random scenes."""
