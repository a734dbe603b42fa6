"""What is usual of quadrotors, where a flight does not tell: each with the range that is claimed
for it in place of an interval.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Usual:
    """Ratios of the vehicles that come with the kit (0.03 to 0.5 kg), and the range to allow."""

    # Jz over Jx + Jy: 0.88 to 0.96 of those vehicles; of a flat body it is 1, the most there is
    flat: float = 0.9
    flat_range: tuple[float, float] = (0.75, 1.0)
    # (Jx + Jy) / 2 over mass times the squared arm: 0.35 to 0.58 of those vehicles
    gyration: float = 0.45
    gyration_range: tuple[float, float] = (0.25, 0.8)
    # reaction torque over thrust, as a share of the arm: 0.18 to 0.24 of those vehicles
    reach: float = 0.2
    reach_range: tuple[float, float] = (0.1, 0.4)
    radius: float = 0.78  # of a rotor, as a share of the arm: 0.71 to 0.83
    hover_speed: float = 1000.0  # rad/s, where no log says what a rotor's speed is


USUAL = Usual()
