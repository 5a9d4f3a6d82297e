"""What draws a sheet: pyvista as pixels, or matplotlib as vectors."""
