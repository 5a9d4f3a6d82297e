"""What the library is compared with: other codes, and plain scikit-fem.

They share its definitions of fabric, kinematics and scenes, and nothing of its plies,
load stepper and solvers.
"""
