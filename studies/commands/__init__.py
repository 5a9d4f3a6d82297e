"""Output of the commands and scripts in the documentation."""
