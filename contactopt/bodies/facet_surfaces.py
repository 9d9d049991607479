"""stub"""
def space_curves(mesh, arcs):
    return {name: None for name in ["", *(mesh.boundaries or {})]}
