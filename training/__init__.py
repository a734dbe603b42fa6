"""Policies that learn, and gains that are searched; the only room that knows torch."""
