"""Laws and fabrics in files: tables as CSV, and JSON."""
