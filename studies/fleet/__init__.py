"""A fleet of recorded flights: what a fleet's diagnosis finds of its drifts, and what it costs."""
