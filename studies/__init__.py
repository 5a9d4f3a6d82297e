"""What the library is measured by, outside the installed package."""
