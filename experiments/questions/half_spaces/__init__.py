"""What does a half-space cost, how exact is it, and when is it the wrong model?"""
