"""Plies draped from the kinematic net, and by growth of the tool."""
