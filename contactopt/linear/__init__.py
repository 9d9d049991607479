"""Linear algebra that knows no mechanics: operators known by their products, convolutions, stacked
vectors, threads.
"""
