"""What a user of a diagnosis may set."""

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class DiagnosisSettings:
    """Which logs a diagnosis takes, from when on a name is sure, and what is reported."""

    least_seconds_each: float = 3.0  # s of flight, where several logs are given together
    least_sure_probability: float = 0.95  # if nothing acts but effects of the library
    most_unknown: float = 0.25  # probability that something else acts, beside which a name is sure
    least_worth: float = 1.0  # times what is left, in the channel where the effect does most
    least_seconds: float = 10.0  # of flight; a shorter one names nothing surely
    # share of the likeliest set's probability from which another effect in a place of it is one
    # that the flights do not tell from it: a likelihood of 20 to 1
    least_rival: float = 0.05
    least_stated: float = 0.001  # probability of an alternative that is reported
    least_size: float = 0.1  # typical sizes, from which a calibration is worth a name
    least_rotor_time_offset: float = 0.001  # s, worth a note
    # standard deviations that chance makes: of a nuisance that is worth a note, and of a prior, by
    # which others may differ in an effect's place
    least_in_std: float = 3.0
    # deviance by which an effect of typical size is sure: of one of some thirty effects, before
    # which one is expected, 20 to 1 afterwards
    least_shown: float = 13.0

    def __repr__(self) -> str:
        """Return what differs from the defaults, so that a signature can be read."""
        own = (f for f in fields(self) if getattr(self, f.name) != f.default)
        return f"DiagnosisSettings({', '.join(f'{f.name}={getattr(self, f.name)!r}' for f in own)})"


DIAGNOSIS = DiagnosisSettings()
