"""A demonstration: a vehicle flies, feels the wind, is diagnosed, and flies better."""
