"""What changed between two sets of flights of one vehicle, without a model that is true."""
