"""A day of a live stream, and how soon an estimate is out."""
