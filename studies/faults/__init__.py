"""What faults of poses and rotor speeds do to the estimators."""
