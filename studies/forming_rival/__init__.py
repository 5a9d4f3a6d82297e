"""A ply formed by a hemispherical punch, in this library and other codes."""
