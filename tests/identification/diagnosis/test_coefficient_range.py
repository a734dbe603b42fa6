"""A named effect that is bent to the limits of its law is no sure name."""

from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.studies.trials.practice_flights import fly_practice

VEHICLE = load_vehicle("ardrone2")


def test_a_dry_friction_is_no_sure_drag():
    log = fly_practice(
        VEHICLE, trajectory="vertical", seconds=40.0, seed=3, outsider="dry_friction", sensor=2.0
    )
    found = diagnose([log], VEHICLE)
    assert found.verdict in ("partly explained", "unexplained")
    assert all(effect.tentative for effect in found.effects)
