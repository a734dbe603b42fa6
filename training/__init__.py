"""Training of policies, and the search for gains; the only room with torch."""
