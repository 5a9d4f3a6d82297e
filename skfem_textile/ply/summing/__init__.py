"""Terms of a ply: their validation and their sum."""
