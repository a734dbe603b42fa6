"""How right identified vehicles are: simulated ones whose truth is known."""
