"""Does CalculiX find the same contact forces on the same mesh?"""
