"""Effect of the constants of the solver, tools, outlines and nets."""
