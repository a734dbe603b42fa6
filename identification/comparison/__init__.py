"""Changes between two sets of flights of one vehicle, without a true model."""
