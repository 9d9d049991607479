"""Does the answer depend on the first mesh, and is its claimed error true?"""
