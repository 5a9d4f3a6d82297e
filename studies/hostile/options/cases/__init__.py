"""Case files and the tables that they name, damaged."""
