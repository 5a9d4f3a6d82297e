"""Laws of published fabrics, fitted to their measurements, for the catalogue."""
