"""Fibres at angles other than 45°: how far the load of the bias extension is off."""
