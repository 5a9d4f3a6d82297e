"""Strips and the two-element model of Hamila & Boisse (2013), against their values."""
