"""Every formulation on every scene: how far strains, load and shape are from exact."""
