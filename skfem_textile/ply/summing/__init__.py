"""The sum of the terms of a ply, its check, and its memory."""
