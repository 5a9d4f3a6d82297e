"""Fibre directions and fabrics of files on the command line."""
