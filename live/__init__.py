"""Beside a vehicle in flight: streams of its messages, and the filter exported to C."""
