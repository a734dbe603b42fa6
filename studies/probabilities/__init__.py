"""Whether the probabilities of a diagnosis mean what they say: flights of two simulators, ranked."""
