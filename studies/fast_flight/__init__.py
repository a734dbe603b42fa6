"""What the library of effects says of force at 3 to 18 m/s, on flights that the fit never saw."""
