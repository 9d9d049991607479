"""One place solves a scene; the contact zone, the load path and several meshes are loops around it."""
