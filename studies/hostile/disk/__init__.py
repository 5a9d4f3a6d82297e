"""Runs that are killed, and disks that are full or read-only."""
