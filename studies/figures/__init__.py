"""Results of studies in the documentation: write, compare and recompute."""
