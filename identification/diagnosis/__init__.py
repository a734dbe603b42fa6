"""Effects missing in the model of a vehicle, by its flights: columns of effects, the evidence of
sets of them, and the findings.
"""

from .diagnosing import diagnose

__all__ = ["diagnose"]
