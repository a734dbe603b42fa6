"""The page of the winds: spectra against theory, and a picture of each wind."""
