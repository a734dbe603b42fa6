"""On the vehicle: streams from vehicles, and the filter exported to C."""
