"""A Crazyflie's log through cflib, against firmware that is played behind a link driver."""

import threading

import numpy as np
import pytest

from tests.live.stream import flight
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.live.session import Session, SessionSettings
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies

pytest.importorskip("cflib", reason="cflib is not installed: pip install 'windwrench[crazyflie]'")

import cflib.crtp

from tests.support.crazyflie_link import PLAIN, WITH_RPM, FakeLink, values_of

VEHICLE = load_vehicle("crazyflie")
COMMANDER = (0x03, 0x07, 0x08)  # ports that move the vehicle


@pytest.fixture(autouse=True)
def _link(monkeypatch):
    monkeypatch.setattr(cflib.crtp, "CLASSES", [FakeLink])
    monkeypatch.setattr(FakeLink, "opened", [])
    monkeypatch.setattr(FakeLink, "variables", WITH_RPM)


def run(play, vehicle=VEHICLE, text="crazyflie:fake://here", **settings):
    """Run a session while ``play(link)`` sends its log."""
    tallies, outputs, failed = Tallies(), [], []
    session = Session(
        make_source(text, vehicle, None, tallies),
        vehicle,
        tallies,
        settings=SessionSettings(**{"wait": 0.0} | settings),
        tell=outputs.append,
    )

    def work():
        try:
            session.run()
        except InputError as error:
            failed.append(str(error))

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    blocks = 2 if "imu=1" in text else 1
    while thread.is_alive() and not (FakeLink.opened and len(FakeLink.opened[0].started) == blocks):
        thread.join(0.01)
    if thread.is_alive():
        play(FakeLink.opened[0], lambda n, kind="row": wait(session, n, thread, kind))
    session.stop()
    thread.join()
    return session, outputs, failed


def wait(session, count, thread, kind="row"):
    """Until so many of a kind were taken."""
    while thread.is_alive() and (
        kind not in session.tallies.rates or session.tallies.rates[kind].count < count
    ):
        thread.join(0.01)


def test_a_log_by_the_radio_protocol_with_faults():
    """Rows that are lost and doubled, and stamps that begin at 0 again."""
    flown = flight(6.0, "gentle", "crazyflie")
    start = 2**24 - 2000  # ms

    def play(link, taken):
        sent = 0
        for k in range(0, 1000, 2):
            if 400 <= k < 410:  # 5 are lost
                continue
            link.log(start + 5 * k, values_of(flown, k))
            sent += 1
            if k == 500:
                link.log(start + 5 * k, values_of(flown, k))
                sent += 1
            if k % 100 == 0:
                taken(sent)
        taken(sent)

    session, outputs, failed = run(play)
    assert not failed
    session.tallies.counts.pop("stops", None)  # of the sender, on a busy machine
    assert dict(session.tallies.counts) == {"lost": 5, "doubled": 1}
    assert len(outputs) == 495
    times = np.array([o.t for o in outputs])
    np.testing.assert_allclose(np.diff(times)[:190], 0.01, atol=1e-9)
    row = outputs[100].row
    k = 200
    np.testing.assert_allclose(row.position, flown["position"][k], atol=1e-6)
    assert abs(abs(row.quaternion @ flown["quaternion"][k]) - 1.0) < 5e-6
    np.testing.assert_allclose(row.rotor_speeds, flown["rotor_speeds"][k], atol=0.1)
    assert row.voltage == pytest.approx(3.9, abs=0.01)
    # its weak turbulence apart, nothing pushes
    found = np.mean([o.estimate.force for o in outputs[300:]], axis=0)
    assert np.abs(found).max() < 0.03 * VEHICLE.weight
    link = FakeLink.opened[0]
    assert link.closed
    assert not [one for one in link.sent if one[0] in COMMANDER]  # nothing that moves it, ever


def test_pwm_by_the_motor_curve(monkeypatch):
    monkeypatch.setattr(FakeLink, "variables", PLAIN)
    from dataclasses import replace

    flown = flight(6.0, "gentle", "crazyflie")
    full = float(VEHICLE.k[0] * 2600.0**2)  # N of a rotor at full command
    vehicle = replace(VEHICLE, motor_curve=MotorCurve((0.0, full)))

    def play(link, taken):
        for k in range(0, 200, 2):
            link.log(5 * k, values_of(flown, k))
        taken(100)

    _, outputs, failed = run(play, vehicle)
    assert not failed
    assert outputs[-1].row.commanded
    np.testing.assert_allclose(outputs[50].row.rotor_speeds, flown["rotor_speeds"][100], rtol=1e-3)
    _, _, failed = run_again(play)
    assert "states no motor_curve" in failed[0]


def run_again(play):
    FakeLink.opened.clear()
    return run(play)


def test_gyro_and_accelerometer_come_in_si():
    flown = flight(6.0, "gentle", "crazyflie")

    def play(link, taken):
        for k in range(0, 200, 2):
            values = values_of(flown, k)
            values |= {"gyro.x": 90.0, "gyro.y": 0.0, "gyro.z": 0.0}
            values |= {"acc.x": 0.0, "acc.y": 0.0, "acc.z": 1.0}
            link.log(5 * k, values)
        taken(100)
        taken(91, "imu")

    session, _, failed = run(play, text="crazyflie:fake://here?imu=1")
    assert not failed
    assert session.tallies.rates["imu"].count > 90


def test_a_firmware_without_a_variable_is_told(monkeypatch):
    monkeypatch.setattr(FakeLink, "variables", tuple(v for v in PLAIN if v[0] != "pm.vbat"))
    _, _, failed = run(lambda link, taken: None)
    assert "Variable pm.vbat not in TOC" in failed[0]


def test_a_link_that_is_lost_ends_the_stream():
    flown = flight(6.0, "gentle", "crazyflie")

    def play(link, taken):
        for k in range(0, 100, 2):
            link.log(5 * k, values_of(flown, k))
        taken(50)
        link.fail("too many packets lost")

    _, outputs, failed = run(play)
    assert not failed
    assert len(outputs) == 50


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("crazyflie:nowhere://0", "no Crazyflie there: No driver found"),
        ("crazyflie:", "expected the address"),
        ("crazyflie:fake://here?period=1", "at least 10"),
    ],
)
def test_no_crazyflie(text, said):
    with pytest.raises(InputError, match=said):
        make_source(text, VEHICLE, None, Tallies()).open()
