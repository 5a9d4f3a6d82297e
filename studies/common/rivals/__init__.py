"""Other codes, and plain scikit-fem, that the library is compared with.

They share its definitions of fabric, kinematics and scenes, and nothing of its plies,
load stepper and solvers.
"""
