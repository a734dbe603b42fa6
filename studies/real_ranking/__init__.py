"""Published flights of one vehicle in a wall of fans, beside the same flights simulated."""
