"""How often the map that is guessed for a table of unknown columns is right, flagged or wrong."""
