"""Ply in 3D against exact solutions: bending, buckling, extreme stiffness ratios."""
