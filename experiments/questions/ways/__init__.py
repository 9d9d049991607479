"""Which way to the solution is the cheapest on meshes that nobody prepared?"""
