"""Of mass, inertia and a scale of thrust any two that change alike may be the third."""

import pytest

from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis.composite import composites

VEHICLE = load_vehicle("ardrone2")
LIGHTER = {"mass": {"dm": -0.1 * VEHICLE.mass}}
WEAKER = {"thrust_scale": {"s": -0.1}}
SLUGGISH = {"inertia": {"jx": -0.1, "jy": -0.1, "jz": -0.1}}
STIFFER = {"inertia": {"jx": 0.1, "jy": 0.1, "jz": 0.1}}


@pytest.mark.parametrize(
    ("setting", "third"),
    [
        (LIGHTER | WEAKER, "inertia"),
        (WEAKER | SLUGGISH, "mass"),
        (LIGHTER | SLUGGISH, "thrust_scale"),
        (LIGHTER | STIFFER, ""),
        (LIGHTER, ""),
    ],
)
def test_two_that_change_alike_may_be_a_third(setting, third):
    std = {effect: dict.fromkeys(values, 0.002) for effect, values in setting.items()}
    found = composites(VEHICLE, setting, std)
    assert len(found) == bool(third)
    assert all(third in sentence.split(": ")[1] for sentence in found)
