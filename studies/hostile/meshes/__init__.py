"""Damaged mesh files: files of sound meshes, their damage, and the library's answer."""
