"""Constitutive laws of tension and shear, by families."""
