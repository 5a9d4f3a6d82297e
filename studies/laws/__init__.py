"""Load error of the bias extension with five constitutive laws."""
