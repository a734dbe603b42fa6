"""Experiments: flying controllers through episodes and comparing them."""
