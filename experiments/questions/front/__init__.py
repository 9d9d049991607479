"""What does accuracy cost, and which error is the largest?"""
