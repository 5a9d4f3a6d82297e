"""Plain readers of mesh and sweep files, independent of the library and of meshio."""
