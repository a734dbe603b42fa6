"""The exported C filter against the Python one, and what it needs on a microcontroller."""
