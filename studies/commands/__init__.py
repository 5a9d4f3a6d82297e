"""What the commands and scripts of the documentation print and write."""
