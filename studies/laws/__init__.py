"""The bias extension with five laws: how far the load is from a converged one."""
