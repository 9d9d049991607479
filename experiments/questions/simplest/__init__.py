"""What may be left out of a scene before it is solved, and what does that save?"""
