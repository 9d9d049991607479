"""How much accuracy does a second buy on the whole way, from the mesh to the answer?"""
