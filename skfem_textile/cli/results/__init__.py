"""The folder of a run, its pictures, and curves of tests."""
