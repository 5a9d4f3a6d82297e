"""Plies on tools: the tool under them, and what they meet."""
