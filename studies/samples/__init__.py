"""Share of repeated tests whose load is within the band of the samples of a fabric."""
