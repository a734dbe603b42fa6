"""Whether the probabilities of a diagnosis mean what they say, on flights of two simulators."""
