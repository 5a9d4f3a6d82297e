"""Plies formed between tools: reference hemisphere, and hemispheres drawn at random."""
