"""Senders whose clocks are not ours: simulators at any rate, paused ones, restarted ones; by their
messages, with and without stamps. No time passes: messages carry the times at which they come.
"""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng

from tests.live import stream
from tests.live.stream import (
    VEHICLE,
    Pipeline,
    as_objects,
    rpm_of,
    send_odometry,
    send_rotors,
)
from tests.support.sizes import rms
from windwrench.live.messages import SECOND
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies

START = 100.0  # s, on our clock
LATENCY = 0.005  # s: delays of 5 to 20 ms
JITTER = 0.015


def flight():
    """A flight whose poses need no stamp: in 15 ms it moves by less than they are off."""
    return stream.flight(8.0, "gentle")


def times_of(flown, ours, jitter=JITTER, bursts=(), in_order=False):
    """When messages come, s on our clock, with their kinds and rows: rotor speeds of each row, a
    pose of every second. ``ours`` makes our time of the sender's.
    """
    rng = default_rng(1)
    found = []
    for k, t in enumerate(flown["t"]):
        for kind in ("motors", "pose")[: 2 - k % 2]:
            at = ours(t) + LATENCY + rng.uniform(0.0, jitter)
            at = next((end for begin, end in bursts if begin <= at < end), at)
            found.append([START + at, kind, k])
    if in_order:
        for before, one in pairwise(found):
            one[0] = max(one[0], before[0])
    return sorted(found, key=lambda one: one[0])


FIELDS = {
    "motors": [f"omega{i}" for i in range(1, 5)],
    "pose": ["px", "py", "pz", "qw", "qx", "qy", "qz"],
}


class Json:
    """Objects of JSON, of one sender until ``moves``, s, and then of another."""

    def __init__(self, flown, moves=np.inf):
        self.flown = flown
        self.objects = as_objects(flown)
        self.moves = moves
        self.source = make_source("udp-json://:9", VEHICLE, None, Tallies())

    def message(self, kind, k, stamp):
        named = {} if stamp is None else {"t": stamp}
        named |= {name: self.objects[k][name] for name in FIELDS[kind]}
        return named, ("127.0.0.1", 1 + int(self.flown["t"][k] > self.moves))


class Mavlink:
    """Messages of an autopilot; rotor speeds without a stamp are those that ArduPilot sends."""

    def __init__(self, flown):
        common = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
        from windwrench.live.sources.esc_status import add_esc_status

        self.flown = flown
        self.esc_status = add_esc_status(common)
        self.source = make_source("mavlink:udp://:9?pose=ODOMETRY", VEHICLE, None, Tallies())
        self.source.link.sender = "here"
        self.bytes = []
        self.sender = common.MAVLink(SimpleNamespace(write=self.bytes.append), srcSystem=7)
        self.parser = common.MAVLink(None)

    def message(self, kind, k, stamp):
        flown = self.flown
        us = round(1e6 * (stamp or 0.0))
        if kind == "pose":
            send_odometry(self.sender, us, flown, k)
        elif stamp is None:
            self.sender.esc_telemetry_1_to_4_send(*[[0] * 4] * 4, rpm_of(flown, k), [0] * 4)
        else:
            send_rotors(self.sender, self.esc_status, us, flown, k)
        return self.parser.parse_buffer(self.bytes.pop())[0]


def played(sender, times, stamped, stamp_of=lambda kind, t: t):
    """The stream of a sender's messages; ``stamped`` are the kinds that have a stamp."""
    live = Pipeline()
    flown = sender.flown
    for at, kind, k in times:
        stamp = stamp_of(kind, float(flown["t"][k])) if kind in stamped else None
        message = sender.message(kind, k, stamp)
        live.take([sender.source.decode(message, round(at * SECOND))])
    return live


def error_of(live, after=4.0):
    """Root mean square of the force's error, N."""
    t = live.wrench()[:, 0]
    force = live.wrench()[:, 1:4]
    truth = [np.interp(t - t[0], flight()["t"], part) for part in flight()["force"].T]
    wrong = force - np.transpose(truth)
    return float(rms(wrong[t - t[0] > after]))


def followed(sender, ours, **how):
    """The stream of a flight by a sender's kind and the kinds that are stamped: no pose comes too
    late and none is lost.
    """
    flown = flight()
    kind, stamped = sender
    live = played(kind(flown), times_of(flown, ours, **how), stamped)
    assert live.tallies.counts["too late"] == 0
    assert len(live.outputs) >= 795  # the first poses wait for rotor speeds
    return live


def lasted(live):
    """The stream's own time, s."""
    return live.outputs[-1].t - live.outputs[0].t


BOTH = (Json, ("motors", "pose"))
POSES = (Json, ("pose",))
MOTORS = (Json, ("motors",))
STAMPED = (Mavlink, ("motors", "pose"))
TELEMETRY = (Mavlink, ("pose",))  # rotor speeds are placed by poses


@pytest.mark.parametrize(
    ("sender", "rate"),
    [(POSES, 0.5), (STAMPED, 0.5), (MOTORS, 1.5), (TELEMETRY, 1.5), (BOTH, 1.0)],
)
def test_a_simulator_of_any_rate_has_no_pose_too_late(sender, rate):
    """The filter's steps are the simulator's: so is the stream's time, and the force is right."""
    live = followed(sender, lambda t: t / rate)
    assert live.session.watch.poses == 801
    assert lasted(live) == pytest.approx(8.0, abs=0.06)
    assert live.session.filter.restarts == 0
    assert error_of(live) < 0.04
    said = " ".join(live.tallies.news())
    if abs(rate - 1.0) > 0.01 and 8.0 / rate > 10.5:
        assert f"the sender's clock runs at {rate:.2f}" in said
    elif rate == 1.0:
        assert not said


PAUSED = {
    "paused for 2 s": lambda t: t + 2.0 * (t > 4.0),
    "paused for 0.2 s, often": lambda t: t + 0.2 * np.floor(t),
    "a rate that comes and goes": lambda t: t + 0.3 * np.sin(1.2 * t),
}


@pytest.mark.parametrize(
    ("sender", "pace"), [*zip((BOTH, TELEMETRY, TELEMETRY), PAUSED, strict=True)]
)
def test_a_clock_that_changes_its_rate_costs_no_pose(sender, pace):
    live = followed(sender, PAUSED[pace])
    assert lasted(live) == pytest.approx(8.0, abs=0.11)
    assert error_of(live) < 0.06


@pytest.mark.parametrize(("sender", "in_order"), [(BOTH, True), (TELEMETRY, False)])
def test_bursts_of_a_link_cost_no_pose(sender, in_order):
    """Nothing comes for up to 0.5 s, then all at once, of a simulator at 0.9 of real time."""
    bursts = [(2.0, 2.5), (4.0, 4.2), (6.0, 6.1)]
    live = followed(sender, lambda t: t / 0.9, bursts=bursts, in_order=in_order)
    assert error_of(live) < 0.1


@pytest.mark.parametrize(("sender", "rate"), [(MOTORS, 0.5), (STAMPED, 1.5), (TELEMETRY, 0.5)])
def test_a_sender_that_restarts_is_followed_after_20_messages(sender, rate):
    """Stamps begin at zero again, of two kinds of messages that come in turns."""
    flown = flight()
    kind, stamped = sender
    live = played(
        kind(flown),
        times_of(flown, lambda t: t / rate),
        stamped,
        lambda kind, t: t - 4.0 if t > 4.0 else t,
    )
    assert live.tallies.counts["clock jumps"] == 1
    assert live.tallies.counts["too late"] <= 3  # before the last ones of the old clock
    assert live.session.watch.too_late <= 1
    doubted = max(20, 0.2 * rate * (200 * ("motors" in stamped) + 100 * ("pose" in stamped)))
    assert live.tallies.counts["implausible times"] <= 1.2 * doubted
    assert lasted(live) == pytest.approx(8.0, abs=0.06)


@pytest.mark.parametrize("stamped", [("motors", "pose"), ("pose",)])
def test_another_sender_in_place_of_a_silent_one_is_another_clock_at_once(stamped):
    """Also where the first message that comes of it has no stamp."""
    flown = flight()
    times = times_of(flown, lambda t: t + 2.5 * (t > 4.0))
    live = played(Json(flown, 4.0), times, stamped, lambda kind, t: t - 4.0 * (t > 4.0))
    assert live.tallies.found.keys() <= {"clock jumps", "late", "waiting"}
    assert live.tallies.counts["clock jumps"] == 1
    assert len(live.outputs) >= 795
    assert lasted(live) == pytest.approx(10.5, abs=0.06)


def test_where_poses_stop_the_estimate_goes_on_in_the_senders_time():
    """Rotor speeds without a stamp carry it for 2 s, as those with one do."""
    flown = flight()
    times = [
        one
        for one in times_of(flown, lambda t: t / 0.5)
        if one[1] == "motors" or not 4.0 < flown["t"][one[2]] < 6.0
    ]
    live = played(Json(flown), times, ("pose",))
    assert live.tallies.counts["too late"] == 0
    gap = [o.t for o in live.outputs if 4.2 < o.t < 5.9]
    assert len(gap) >= 9  # a row each 0.15 s
    assert np.diff(gap).max() < 0.2


def test_a_stream_without_any_stamp_is_in_our_time_and_says_so():
    flown = flight()
    live = played(Json(flown), times_of(flown, lambda t: t, 0.0), ())
    assert len(live.outputs) == pytest.approx(700, abs=3)  # but for a second in which one may come
    assert error_of(live) < 0.04
    assert any("no message has a stamp" in line for line in live.tallies.news())


def test_two_clocks_of_different_rates_are_one_time():
    """Rotor speeds in the simulator's time, poses stamped from 1970 on another clock."""
    live = played(
        Json(flight()),
        times_of(flight(), lambda t: t / 0.5),
        ("motors", "pose"),
        lambda kind, t: 1.7e9 + 0.9 * t / 0.5 if kind == "pose" else t,
    )
    assert live.session.clocks.count == 2
    assert live.tallies.counts["too late"] <= 8  # 1 %
    assert error_of(live) < 0.04


def test_poses_that_are_too_late_are_told_with_their_share():
    flown = flight()
    times = [
        [at + 0.6 * (kind == "pose" and k % 20 == 0), kind, k]
        for at, kind, k in times_of(flown, lambda t: t)
    ]
    live = played(Json(flown), sorted(times), ("motors", "pose"))
    late = live.session.watch.too_late
    poses = live.session.watch.poses
    assert (late, poses) == (77, 801)  # but for the last
    (said,) = live.tallies.news()
    assert "poses came more than 0.3 s late and were left out; --horizon takes later" in said
    assert f"{late} of {poses} poses" in live.session.watch.late_words
