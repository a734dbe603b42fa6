"""Trials of the diagnosis: flights with a known cause, diagnosed and scored."""
