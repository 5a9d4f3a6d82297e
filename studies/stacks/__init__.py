"""Plies that are formed together: against one ply, pulled out, and at other angles."""
