"""Meshes whose edges lie along fibres."""
