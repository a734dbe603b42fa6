"""Libraries of reinforcement learning on the fan-tracking task, each by itself."""
