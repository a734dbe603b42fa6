"""What regenerates this repository's own pages. It runs from a checkout and is not in the wheel."""
