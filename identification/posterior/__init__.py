"""Which effects act, with probabilities: one likelihood of a flight's poses, one posterior."""
