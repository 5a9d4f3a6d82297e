"""The command ``fit``: laws of a fabric from its tests."""
