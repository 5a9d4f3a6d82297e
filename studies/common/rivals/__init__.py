"""Other codes, and plain scikit-fem, for comparison with the library.

They share the fabric, kinematics and scenes of the library, but not its plies, load
stepper and solvers.
"""
