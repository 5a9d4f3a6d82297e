"""Load, components and intervals of simple shear between clamps."""
