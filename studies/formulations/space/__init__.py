"""A ply in space against exact answers: bending, buckling, extreme stiffnesses."""
