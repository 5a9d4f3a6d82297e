"""Studies that measure the library, outside the installed package."""
