"""Machinery under all rooms: errors, files written whole, compiled calls, vector lanes, worker
processes.
"""
