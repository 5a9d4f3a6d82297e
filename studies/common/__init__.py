"""Modules that several studies use."""
