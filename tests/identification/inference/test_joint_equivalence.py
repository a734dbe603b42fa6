"""One effect with several coefficients, and two others that do the same together."""

import numpy as np
import pytest

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.inference.joint_equivalence import used_coefficients
from windwrench.identification.inference.search import FittedEffects
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.report.words import headline


@pytest.mark.parametrize(
    ("values", "expected"),
    [((0.1, 0.0, 0.0, 0.0), 1), ((0.1, 0.02, -0.02, 0.01), 1), ((0.1, 0.1, -0.1, 0.1), 4)],
)
def test_coefficients_within_their_noise_are_not_used(
    values: tuple[float, ...], expected: int
) -> None:
    names = ("e1", "e2", "e3", "e4")
    fit = FittedEffects(
        {"rotor_efficiency": dict(zip(names, values, strict=True))},
        {("rotor_efficiency", name): 0.01 for name in names},
    )
    assert len(used_coefficients(fit, "rotor_efficiency")) == expected


@pytest.mark.slow
def test_a_hover_does_not_surely_name_four_rotors_for_a_torque_and_a_thrust() -> None:
    """In a hover four rotor efficiencies are any constant thrust and torque."""
    vehicle = load_vehicle("ardrone2")
    added = (
        EffectSetting("constant_torque", {"tx": 0.01, "ty": 0.01, "tz": 0.01}),
        EffectSetting("thrust_scale", {"s": 0.05}),
    )
    flown = record_flight(vehicle, added, "hover", 20.0, 5)
    log = FlightLog(
        flown["t"], flown["position"], flown["quaternion"], flown["rotor_speeds"], name="hover"
    )
    found = diagnose([log], vehicle)
    covered = {x for e in found.effects for x in (e.name, *e.indistinguishable_from)}
    if "rotor_efficiency" in [e.name for e in found.effects]:
        assert all(e.tentative for e in found.effects)
        assert any("constant_torque and" in note for note in found.notes)
        assert "perhaps" in headline(found)
    else:
        assert {"constant_torque", "thrust_scale"} <= covered
    assert np.isfinite(found.before.force_rms)
