"""Logs that are not what they claim to be are refused with what they look like; honest ones pass,
whatever they lack.
"""

import re
from dataclasses import replace
from functools import cache
from itertools import permutations

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.support.flown import VEHICLE, noisy, recorded, resting, without_pose
from tests.support.hostile_conventions import permuted
from tests.support.outcomes import refused
from tests.support.parameters import mostly_slow
from tests.support.sizes import rms
from windwrench.dynamics.effects import get, names, parse_setting
from windwrench.dynamics.vehicle import ModelStatus
from windwrench.evidence.trials.practice_flights import practise
from windwrench.identification.logs.evidence import Evidence, log_ranking
from windwrench.identification.logs.flight_log import with_rows, write_log
from windwrench.identification.logs.magnitudes import without_broken_speeds
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.readings import DECLARED
from windwrench.identification.logs.screening import screen_log, stuck_channels
from windwrench.identification.wrench_series import estimate_log

CLEAN = ("excite", "gentle", "circle", "yaw")
# one effect of each kind
SHOWN = ("motor_lag", "rotor_drag", "slung_payload")
EXCITED = [CLEAN[0], pytest.param("yaw", marks=pytest.mark.slow)]


@cache
def flight(trajectory="excite", effect=None, size=2.0, seconds=14.0):
    effects = {}
    if effect is not None:
        limits = {c.name: (c.minimum, c.maximum) for c in get(effect).coefficients}
        effects[effect] = {
            name: float(np.clip(size * value, *limits[name]))
            for name, value in parse_setting(effect, VEHICLE).coefficients.items()
        }
    return replace(recorded(trajectory, seconds, 3, **effects), source="flight.csv")


@pytest.mark.parametrize(
    ("trajectory", "step", "named"),
    [
        (CLEAN[0], 5, None),
        pytest.param(CLEAN[0], 1, None, marks=pytest.mark.slow),
        # calm flights name less likely ones, too
        *(pytest.param(name, 1, 1, marks=pytest.mark.slow) for name in CLEAN[1:]),
    ],
)
def test_every_order_of_rotors_is_told_apart(trajectory, step, named):
    log = flight(trajectory)
    for order in list(permutations(range(4)))[::step]:
        for mirrored in (False, True):
            vehicle = replace(VEHICLE, spin=-VEHICLE.spin) if mirrored else VEHICLE
            evidence = Evidence.of_log(permuted(log, order), vehicle)
            found = log_ranking(evidence).departures()
            rotors = tuple(i + 1 for i in order)
            expected = [] if rotors == (1, 2, 3, 4) and not mirrored else [(rotors, mirrored)]
            if mirrored and rotors in ((2, 3, 4, 1), (4, 1, 2, 3)):
                # the same log as of body axes turned by 90 degrees: one departure in place of two
                expected.insert(0, ((1, 2, 3, 4), False))
                assert "degrees about z" in found[0].says
            read = [(reading.rotors, reading.mirrored) for reading in found]
            assert read[:named] == expected[:named]


def test_rotors_that_work_against_a_cord_turn_as_declared():
    """Slow turns against a spring of the heading need the opposite of what rotors give, as if these
    turned the other way.
    """
    flown = practise(VEHICLE, "outsider", ("winding_cord",), "typical", None, 2714764493)
    assert screen_log(flown.log, flown.vehicle)[1] == ()


@pytest.mark.parametrize(
    ("columns", "signs", "expected"),
    [
        ((1, 2, 0), (1, 1, 1), r"take \(pz, px, py\) as the position"),
        ((1, 0, 2), (-1, -1, 1), r"take \(-py, -px, pz\) as the position"),
    ],
)
@pytest.mark.parametrize("trajectory", EXCITED)
def test_position_columns_along_any_axes_are_named(trajectory, columns, signs, expected):
    """Brisk motion along x alone still agrees with thrust where the two other columns are
    exchanged.
    """
    log = flight(trajectory)
    with refused(expected):
        screen_log(replace(log, position=log.position[:, list(columns)] * signs), VEHICLE)


def test_positions_in_feet_are_named():
    log = flight()
    with refused("px, py, pz look like feet; expected metres: divide them by 3.281"):
        screen_log(replace(log, position=log.position / 0.3048), VEHICLE)


def test_a_leap_of_the_position_is_no_other_convention():
    """The position hangs for 3 s, or motion capture moves its origin: no column is swapped."""
    log = flight("yaw")
    for held in (0.0, 3.0):
        position = log.position.copy()
        position[(log.t > 6.0 - held) & (log.t <= 6.0), 0] = position[log.t > 6.0 - held][0, 0]
        position[log.t > 6.0, 0] += 1.5
        leaping = replace(log, position=position)
        with refused("the pose leaps by .* m within 0.005 s at t = 6"):
            screen_log(leaping, VEHICLE)
        assert any("the pose leaps" in note for note in screen_log(leaping, VEHICLE, None)[1])


@pytest.mark.parametrize("effect", mostly_slow(names(), SHOWN.__contains__))
def test_an_undeclared_effect_is_no_wrong_convention(effect):
    # twice a typical delay in the loop is more than it can fly
    size = 1.0 if effect in ("latency", "clock_offset") else 2.0
    trajectory = "ground" if effect == "ground_effect" else "excite"
    assert screen_log(flight(trajectory, effect, size), VEHICLE)[1] == ()


def test_a_quiet_hover_decides_nothing():
    """Without excitation no order of rotors explains more than another."""
    rng = default_rng(0)
    t = np.arange(0.0, 15.0, 0.005)
    log = resting(t, rotor_speeds=VEHICLE.hover_rate + rng.standard_normal((len(t), 4)))
    position, quaternion = noisy(VEHICLE.mocap, rng, log.position, log.quaternion)
    log = replace(log, position=position, quaternion=quaternion)
    assert screen_log(log, VEHICLE)[1] == ()
    assert Evidence.of_log(log, VEHICLE).fit(DECLARED).torque > 0.5  # there is nothing to tell


def jumped_clock(log):
    k = len(log.t) // 2
    speed = norm(np.gradient(log.position, log.t, axis=0), axis=1)
    k += int(np.argmax(np.convolve(speed[k:], np.ones(21) / 21, "same")[200:-200])) + 200
    return replace(log, t=log.t + np.where(np.arange(len(log.t)) >= k, 5.0, 0.0))


def uneven_clock(log):
    step = default_rng(0).choice([0.0005, 0.005, 0.02], len(log.t), p=[0.4, 0.4, 0.2])
    return replace(log, t=np.cumsum(step))


def held(log):
    rows = np.arange(len(log.t)) // 8 * 8
    return replace(log, position=log.position[rows], quaternion=log.quaternion[rows])


def cut_out(log):
    """The log without 1.3 s, its times counted as if there had been none."""
    kept = with_rows(log, (log.t < 5.0) | (log.t > 6.3))
    return replace(kept, t=log.t[: len(kept.t)])


TORN = {
    "short": (
        lambda log: with_rows(log, log.t < 6.0),
        r"6 of 6 s of flight lie in unbroken runs.*expected at least 10 s",
    ),
    "slow": (
        lambda log: with_rows(log, np.arange(len(log.t)) % 8 == 0),
        r"25 new poses a second; expected at least 50: acceler",
    ),
    "held": (
        held,
        "25 new poses a second",
    ),
    "lost often": (
        lambda log: without_pose(log, log.t % 2.0 < 0.2),
        r"pose is lost in 8 run\(s\).*0 of .* s of flight lie in unbroken runs",
    ),
    "no pose": (lambda log: without_pose(log, log.t > -1.0), "no row has a pose"),
    "uneven clock": (
        uneven_clock,
        "column t: time steps vary wildly.*expected the times at which the poses were taken",
    ),
    "clock jump": (
        jumped_clock,
        r"column t jumps by 5\.\d* s at t = .*, but the pose goes on from where it was",
    ),
    "rows cut out": (
        cut_out,
        r"pose leaps by .* m within 0.005 s at t = 5",
    ),
    "at rest": (
        lambda log: replace(log, rotor_speeds=0.0 * log.rotor_speeds),
        "omega1..omega4 are at rest all the time, or too slow for the 0.465 kg of ardrone2",
    ),
    "dead column": (
        lambda log: replace(log, rotor_speeds=log.rotor_speeds * [1, 1, 0, 1]),
        "omega3 is 0 while the other",
    ),
    "PWM": (
        lambda log: replace(log, rotor_speeds=100.0 * log.rotor_speeds),
        r"expected about 1: omega1..omega4 in rad/s",
    ),
}


ENOUGH = ("short", "slow", "held", "lost often", "uneven clock")
PARTS = ("clock jump", "rows cut out")


@pytest.mark.parametrize("kind", TORN)
def test_a_torn_log_is_refused_and_an_estimate_needs_less(kind):
    make, expected = TORN[kind]
    log = make(flight())
    said = f"flight.csv: .*{expected}"
    with refused(said):
        screen_log(log, VEHICLE)
    if kind in (*ENOUGH, *PARTS):
        notes = screen_log(log, VEHICLE, None)[1]
        assert len(notes) == (kind in PARTS)
        assert all(re.match(f"warning: .*{expected}", note) for note in notes)
    else:
        with refused(said):
            screen_log(log, VEHICLE, None)


def test_a_gap_that_leaves_enough_is_a_note():
    log = flight(seconds=20.0)
    _, (note,) = screen_log(without_pose(log, abs(log.t - 10.0) < 2.0), VEHICLE)
    assert note.startswith("the pose is lost in 1 run(s)")
    assert "16 of 20 s of flight" in note
    # a gap in which the vehicle flew on is no jump of the clock
    screen_log(with_rows(log, abs(log.t - 10.0) > 0.5), VEHICLE)


def test_two_seconds_and_a_hover_are_enough_for_an_estimate():
    log = flight("hover")
    for seconds in (2.0, 10.0):
        assert screen_log(with_rows(log, log.t < seconds), VEHICLE, None)[1] == ()


def test_a_frozen_pose_counts_as_none():
    log = flight()
    frozen = (log.t >= 5.0) & (log.t <= 6.0)
    first = int(np.argmax(frozen))
    position = log.position.copy()
    quaternion = log.quaternion.copy()
    position[frozen] = position[first]
    quaternion[frozen] = quaternion[first]
    log = replace(log, position=position, quaternion=quaternion)
    checked, notes = screen_log(log, VEHICLE, None)
    assert any("pose is frozen for 0.995 s from t = 5.005 s (1 in" in note for note in notes)
    assert_array_equal(checked.valid, ~(frozen & (np.arange(len(log.t)) != first)) & log.valid)


@pytest.mark.parametrize("channel", ["position", "quaternion"])
def test_a_pose_without_a_change_is_refused(channel):
    log = flight()
    still = replace(log, **{channel: 0 * getattr(log, channel) + 0.5})
    with refused(r"flight.csv: the (position|attitude) \(.* never changes"):
        screen_log(still, VEHICLE)


def test_rotors_that_stop_or_race_are_named():
    log = flight()
    stopped = log.rotor_speeds.copy()
    racing = log.rotor_speeds.copy()
    stopped[(log.t > 7.0) & (log.t < 8.0), 2] = 0.0
    racing[[700, 1500], 1] = 4e4
    for speeds, words in (
        (stopped, r"omega3 is 0 while the other rotors turn, for 0.99 s from t = 7.005 s"),
        (racing, r"omega2 reads 4e\+04 rad/s at t = 3.5 s \(2 such value"),
    ):
        spoiled = replace(log, rotor_speeds=speeds)
        checked, notes = screen_log(spoiled, VEHICLE, None)
        assert any(re.search(words, note) for note in notes)
        with refused(words):
            screen_log(spoiled, VEHICLE)
    assert checked.rotor_speeds.max() < 1.5 * log.rotor_speeds.max()
    slower = replace(
        VEHICLE,
        omega_max=0.5 * float(log.rotor_speeds.min(initial=1e3, where=log.rotor_speeds > 0.0)),
    )
    with refused("faster than ardrone2 turns its rotors"):
        screen_log(log, slower, None)  # nothing is left to interpolate from


def test_another_vehicle_than_the_log_names_is_doubted():
    _, (note,) = screen_log(replace(flight(), vehicle="crazyflie"), VEHICLE)
    assert note == "warning: the log names the vehicle crazyflie; it is read as ardrone2"
    own = replace(VEHICLE, status=ModelStatus(coefficients={"k": "identified"}))
    assert screen_log(replace(flight(), vehicle="crazyflie"), own)[1] == ()


def test_a_log_names_its_vehicle(tmp_path):
    log = with_rows(flight(), flight().t < 0.1)
    for name, suffix in (("crazyflie", ".csv"), ("my own-1", ".parquet"), ("no,name\x1b", ".csv")):
        path = tmp_path / f"flight{suffix}"
        write_log(replace(log, vehicle=name), path)
        assert read_log(path).vehicle == ("" if "," in name else name)
        if suffix == ".csv":
            assert np.loadtxt(path, delimiter=",", skiprows=1).shape[0] == len(log.t)
    header, _, body = path.read_text().partition("\n")
    lines = [f"{line},1" for line in body.splitlines()]
    path.write_text(
        "\n".join([f"{header},rest", *lines])
        .replace("vbat", "vehicle=a", 1)
        .replace("rest", "vehicle=b", 1)
    )
    with refused("name the vehicles a and b; expected one"):
        read_log(path)


def test_restarts_are_one_note():
    log = flight(seconds=20.0)
    series = estimate_log(without_pose(log, log.t % 5.0 < 2.2), VEHICLE)
    (note,) = [note for note in series.notes if "restarted" in note]
    assert "t = 7.2 s, 3 times in all" in note
    assert series.restarts[-1] == 3


# channels that stand still or repeat another; tests/fuzz/test_answers.py holds what an estimate
# makes of such logs


def test_rotors_that_are_alike_in_pairs_are_a_flight_in_a_plane():
    log = flight()
    pairs = replace(log, rotor_speeds=log.rotor_speeds[:, [0, 1, 1, 0]])
    assert not [note for note in stuck_channels(pairs, VEHICLE) if "equal in every row" in note]
    twice = replace(log, rotor_speeds=log.rotor_speeds[:, [0, 1, 2, 1]])
    (note,) = [note for note in stuck_channels(twice, VEHICLE) if "equal in every row" in note]
    assert "motors 2 and 4" in note
    assert not [*stuck_channels(replace(twice, notes=(note,)), VEHICLE)]  # said at its reading


def test_a_clean_flight_and_a_rotor_at_its_limit_are_not_noted():
    log = flight()
    assert not [*stuck_channels(log, VEHICLE)]
    limited = replace(VEHICLE, omega_max=float(np.quantile(log.rotor_speeds, 0.3)))
    clipped = np.minimum(log.rotor_speeds, limited.omega_max)
    clipped[:, 0] = limited.omega_max
    assert not [*stuck_channels(replace(log, rotor_speeds=clipped), limited)]


def test_commands_that_run_seconds_late_are_named_by_the_thrust_alone():
    """No torque is known of a collective command; the force along the thrust axis is enough."""
    log = flight("excite", seconds=25.0)
    collective = rms(log.rotor_speeds, axis=1)
    on_time = replace(log, rotor_speeds=np.tile(collective[:, None], 4), commanded=True)
    screen_log(on_time, VEHICLE)
    late = np.interp(log.t - 2.25, log.t, collective)
    with refused(r"flight\.csv: .* come 2\.2\d s too late .* commands"):
        screen_log(replace(on_time, rotor_speeds=np.tile(late[:, None], 4)), VEHICLE)


def test_broken_rotor_speeds_are_interpolated_and_said():
    """Two samples of 33,036 rad/s in a minute made k 4 % too small."""
    log = recorded("excite", 12.0)
    speeds = log.rotor_speeds.copy()
    speeds[700, 1] = speeds[701, 1] = 33036.0
    speeds[900, 2] = 104720.0
    mended, (line,) = without_broken_speeds(replace(log, rotor_speeds=speeds))
    assert "3 rotor speeds are broken, up to 104720 rad/s" in line
    assert_array_equal(mended.rotor_speeds[:, 0], log.rotor_speeds[:, 0])
    assert abs(mended.rotor_speeds - log.rotor_speeds).max() < 0.1 * log.rotor_speeds.mean()
    same, none = without_broken_speeds(log)
    assert same is log
    assert none == []
