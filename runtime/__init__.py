"""Machinery under all rooms: errors, files written whole, worker processes."""
