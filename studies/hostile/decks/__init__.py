"""Trials of damaged decks with fabrics and fibre directions."""
