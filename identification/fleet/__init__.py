"""Many logs of many vehicles: one diagnosis each, and what changed from flight to flight."""
