"""Fan-tracking environments side by side in the lanes of a vector unit."""
