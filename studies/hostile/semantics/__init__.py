"""Meshes, conditions, laws and settings that nobody can mean, one by one."""
