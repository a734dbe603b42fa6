"""A Crazyflie's log through cflib, against firmware that is played behind a link driver."""

from dataclasses import replace

import numpy as np
import pytest

from tests.live.stream import Running, flight
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies

pytest.importorskip("cflib", reason="pip install 'windwrench[crazyflie]'")

import cflib.crtp

from tests.support.crazyflie_link import PLAIN, WITH_RPM, FakeLink, values_of

VEHICLE = load_vehicle("crazyflie")
COMMANDER = (0x03, 0x07, 0x08)  # ports that move the vehicle


@pytest.fixture(autouse=True)
def _link(monkeypatch):
    monkeypatch.setattr(cflib.crtp, "CLASSES", [FakeLink])
    monkeypatch.setattr(FakeLink, "opened", [])
    monkeypatch.setattr(FakeLink, "variables", WITH_RPM)


def run(play, vehicle=VEHICLE, text="crazyflie:fake://here"):
    """Run a session while ``play(link, taken)`` sends its log."""
    FakeLink.opened.clear()
    running = Running(text, vehicle)
    blocks = 2 if "imu=1" in text else 1
    running.until(lambda: FakeLink.opened and len(FakeLink.opened[0].started) == blocks)
    if running.thread.is_alive():
        play(FakeLink.opened[0], lambda count, kind="row": running.taken(kind, count))
    return running.end()


def rows_of(rows, flown=None, **values):
    """A play of rows of a flight."""
    flown = flown or flight(6.0, "gentle", "crazyflie")

    def play(link, taken):
        for k in rows:
            link.log(5 * k, values_of(flown, k) | values)
        taken(len(rows))

    return play


def test_a_log_by_the_radio_protocol_with_faults():
    """Rows that are lost and doubled, and stamps that begin at 0 again."""
    flown = flight(6.0, "gentle", "crazyflie")
    start = 2**24 - 2000  # ms
    rows = [*range(0, 400, 2), *range(410, 502, 2), *range(500, 1000, 2)]  # 5 lost, one doubled

    def play(link, taken):
        for n, k in enumerate(rows):
            link.log(start + 5 * k, values_of(flown, k))
            if n % 50 == 0:
                taken(n)
        taken(len(rows))

    found = run(play)
    assert not found.failed
    assert dict(found.tallies.counts) == {"lost": 5, "doubled": 1}
    assert len(found.outputs) == 495
    times = np.array([o.t for o in found.outputs])
    np.testing.assert_allclose(np.diff(times)[:190], 0.01, atol=1e-9)
    row, k = found.outputs[100].row, 200
    np.testing.assert_allclose(row.position, flown["position"][k], atol=1e-6)
    assert abs(abs(row.quaternion @ flown["quaternion"][k]) - 1.0) < 5e-6
    np.testing.assert_allclose(row.rotor_speeds, flown["rotor_speeds"][k], atol=0.1)
    assert row.voltage == pytest.approx(3.9, abs=0.01)
    # its weak turbulence apart, nothing pushes
    force = np.mean([o.estimate.force for o in found.outputs[300:]], axis=0)
    assert np.abs(force).max() < 0.03 * VEHICLE.weight
    link = FakeLink.opened[0]
    assert link.closed
    assert not [one for one in link.sent if one[0] in COMMANDER]  # nothing that moves it, ever


def test_pwm_by_the_motor_curve(monkeypatch):
    monkeypatch.setattr(FakeLink, "variables", PLAIN)
    full = float(VEHICLE.k[0] * 2600.0**2)  # N of a rotor at full command
    found = run(rows_of(range(0, 200, 2)), replace(VEHICLE, motor_curve=MotorCurve((0.0, full))))
    assert not found.failed
    assert found.outputs[-1].row.commanded
    speeds = flight(6.0, "gentle", "crazyflie")["rotor_speeds"][100]
    np.testing.assert_allclose(found.outputs[50].row.rotor_speeds, speeds, rtol=1e-3)
    assert "states no motor_curve" in run(rows_of(range(0, 200, 2))).failed[0]


def test_gyro_and_accelerometer_come_in_si():
    imu = {"gyro.x": 90.0, "gyro.y": 0.0, "gyro.z": 0.0, "acc.x": 0.0, "acc.y": 0.0, "acc.z": 1.0}

    def play(link, taken):
        rows_of(range(0, 200, 2), **imu)(link, taken)
        taken(91, "imu")

    found = run(play, text="crazyflie:fake://here?imu=1")
    assert not found.failed
    assert found.count("imu") > 90
    row = next(o.row for o in found.outputs if o.row.gyro is not None)
    np.testing.assert_allclose(row.gyro, [np.pi / 2, 0.0, 0.0])
    np.testing.assert_allclose(row.accelerometer, [0.0, 0.0, 9.80665])


def test_a_firmware_without_a_variable_and_no_crazyflie_are_told(monkeypatch):
    monkeypatch.setattr(FakeLink, "variables", tuple(v for v in PLAIN if v[0] != "pm.vbat"))
    assert "Variable pm.vbat not in TOC" in run(lambda link, taken: None).failed[0]
    source = make_source("crazyflie:nowhere://0", VEHICLE, None, Tallies())
    with pytest.raises(InputError, match="no Crazyflie there: No driver found"):
        source.open()


def test_a_link_that_is_lost_ends_the_stream():
    def play(link, taken):
        rows_of(range(0, 100, 2))(link, taken)
        link.fail("too many packets lost")

    found = run(play)
    assert not found.failed
    assert len(found.outputs) == 50
