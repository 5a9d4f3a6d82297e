"""Tools in, and draped fibres and flat patterns out."""
