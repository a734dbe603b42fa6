"""The settings of a diagnosis."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DiagnosisSettings:
    """Rules for taking a log, and for a sure name."""

    least_seconds_each: float = 3.0  # s of flight, where several logs are given together
    least_sure_probability: float = 0.95  # if nothing acts but effects of the library
    most_unknown: float = 0.5  # probability of an unknown cause, up to which a name is sure
    least_worth: float = 1.0  # times the rest, in the channel where the effect does most
    least_seconds: float = 10.0  # of flight; a shorter one names nothing surely


DIAGNOSIS = DiagnosisSettings()
