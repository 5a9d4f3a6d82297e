"""Meshes, conditions, laws and settings that cannot be meant, one by one."""
