"""Decks of Abaqus and OpenRadioss: meshes, fibre directions and fabrics."""
