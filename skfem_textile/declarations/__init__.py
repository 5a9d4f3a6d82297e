"""Parameters of laws, formulations, surfaces and scenes: the keys of a case file.

A parameter is a field of a dataclass, with its unit, default and meaning.  The class or
function that has the parameters inherits or takes them, and the table of a case file,
the options of the command line and the reference of all keys are derived from them.
These modules import neither NumPy nor scikit-fem, so that a help text does not either.
"""
