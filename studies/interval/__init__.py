"""Error intervals against converged loads, and runs to a tolerance."""
