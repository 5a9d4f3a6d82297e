"""Terms of the library beside tension, shear and what formulations add."""
