"""Measured flights of public data sets, diagnosed."""
