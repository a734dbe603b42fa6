"""Beside a vehicle that flies: streams from vehicles, and the filter exported to C."""
