"""The same numbers as the forms, for all elements at once, on a fixed pattern."""
