"""Real faults: what is found of them on measured flights, and how sure it may be, on simulated."""
