"""Flights with a known cause, for a diagnosis to be tried on."""
