"""Logs of every fixture with one thing wrong, of a kind that a stranger's log may have: one stamp,
a slow channel, a unit, two rotors more. The answer is a refusal, a note that names it, or that of
the log that was not spoiled; never another one without a word.
"""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.data_paths import DATA, EXCERPTS
from windwrench.dynamics import InputError
from windwrench.identification.logs import reading
from windwrench.identification.logs.log_map import OWN_MAP, UNITS, load_map
from windwrench.identification.logs.readers import (
    TABLES,
    ardupilot_bin,
    betaflight,
    crazyflie_sd,
    px4_ulog,
    reader_by_columns,
)
from windwrench.identification.logs.tables import open_table

Array = NDArray[np.float64]

# of each folder one; most odd logs are wrong already, and have tests of their own
FIXTURES = [
    EXCERPTS / "crazypad" / "normal_flight__E9_log00.csv.gz",
    EXCERPTS / "crazyswarm2" / "log165.csv.gz",
    EXCERPTS / "nanobench" / "B5_helix_fast_rep2.csv.gz",
    DATA / "flights" / "labelled_00.csv.gz",
    DATA / "racer" / "flight_c.csv.gz",
    DATA / "crazyflie_imu" / "log15",
    DATA / "motor_faults" / "TestCase_3_1000000002.ulg",
    DATA / "odd_logs" / "px4_healthy_esc_200hz.ulg",
    DATA / "odd_logs" / "ardupilot_ch1_columns.bin",
]
SLOW_HZ = 4.0
STAMP = 40.0  # s, by which one is wrong
FASTEST = 1.5  # rad/s, from which on degrees are told from radians without a pose
SCALED = {"gyro": 57.3, "accelerometer": 1.0 / 9.81, "position": 1000.0, "battery": 100.0}
KINDS = {  # and words that name it
    "stamp": ("time", "written late", "samples around"),
    "slow": (),
    "six rotors": ("rotors turn",),
    **dict.fromkeys(SCALED, ("look like", "millimetres", "voltages", "contradict")),
}


def named(log_map, *sections):
    """Return the columns of some sections of a map."""
    return {name for part in sections for way in log_map.ways(part) for name in way.named}


def spoiled(kind, name, t, x, log_map):
    """Return a column (N,), of times (N,) in s."""
    if kind == "slow" and name in named(log_map, "rotors", "commands", "wrench"):
        held = np.searchsorted(t, t[0] + np.floor((t - t[0]) * SLOW_HZ) / SLOW_HZ)
        return np.asarray(x[np.minimum(held, len(x) - 1)])
    if kind in SCALED and name in named(log_map, kind):
        return x * SCALED[kind]
    return x


def spoiled_recording(kind, whole):
    """Return ``recording_of`` of what is spoiled."""

    def of(path, recorded, log_map, *others):
        out = []
        for s in recorded:
            columns = {name: spoiled(kind, name, s.t, x, log_map) for name, x in s.columns.items()}
            t = s.t.copy()
            if kind == "stamp" and len(t) > 50:
                t[len(t) // 2] += STAMP
            out.append(replace(s, t=t, columns=columns))
        return whole(path, out, log_map, *others)

    return of


def spoiled_table(kind):
    """Return ``open_table`` of what is spoiled."""

    def opened(path):
        table = open_table(path)
        reader = reader_by_columns(path, table.header)
        log_map = load_map(OWN_MAP if reader is None else TABLES[reader.name])
        clock = next(c for c in log_map.ways("time") if c.column in table.header)
        raw = table.read([clock.column])[clock.column]
        t = (raw - raw[0]) * UNITS["time"][clock.unit]
        motors = sorted(named(log_map, "rotors", "commands") & set(table.header))
        noise = np.random.default_rng(0).standard_normal((table.rows, 2))
        more = {}
        if kind == "six rotors" and motors and motors[0].count("1") == 1:
            turning = table.read(motors[:1])[motors[0]]
            names = (motors[0].replace("1", number) for number in "56")
            more = dict(zip(names, (turning[:, None] * (1.0 + 0.01 * noise)).T, strict=True))
        header = (*table.header, *more)

        def fill(_, where, columns):
            for i, out in zip(where, columns, strict=True):
                name = header[i]
                x = more[name] if name in more else table.read([name])[name]
                out[:] = spoiled(kind, name, t, x, log_map)
                if kind == "stamp" and name == clock.column:
                    out[len(out) // 2] += STAMP / UNITS["time"][clock.unit]

        return replace(table, header=header, fill=fill, numeric=(), _columns={})

    return opened


def read(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return reading.read_log(path)


@cache
def unspoiled(path):
    return read(path)


def is_same(here, there):
    """Return whether a log says what the other says, at the times of both."""
    _, i, j = np.intersect1d(np.round(here.t, 6), np.round(there.t, 6), return_indices=True)
    if len(i) < 0.98 * len(there.t):
        return False
    for name in ("position", "rotor_speeds", "command", "gyro", "accelerometer", "voltage"):
        x, y = getattr(here, name), getattr(there, name)
        if (x is None) != (y is None):
            return False
        if x is not None and np.isfinite(y).any():
            off = np.abs(x[i] - y[j]) > 0.02 * np.nanstd(y) + 1e-9
            if np.mean(off) > 0.02:
                return False
    return True


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("path", FIXTURES, ids=lambda path: path.name)
def test_no_kind_of_fault_passes_without_a_word(path, kind, monkeypatch):
    if not path.exists():
        pytest.skip(f"{path} is not there")
    expected = unspoiled(path)
    gyro = expected.gyro
    if kind == "gyro" and gyro is not None and np.nanquantile(np.abs(gyro), 0.99) < FASTEST:
        pytest.skip("the vehicle turns too little")
    monkeypatch.setattr(reading, "open_table", spoiled_table(kind))
    for module in (ardupilot_bin, betaflight, crazyflie_sd, px4_ulog):
        monkeypatch.setattr(module, "recording_of", spoiled_recording(kind, module.recording_of))
    try:
        found = read(path)
    except InputError:
        return
    said = {*found.notes} - {*expected.notes}
    is_named = any(word in text for text in said for word in KINDS[kind])
    slow = max(0.1 * expected.motor_rate, 1.5 * SLOW_HZ)
    is_slow = kind == "slow" and found.motor_rate < min(slow, 0.5 * expected.motor_rate)
    assert is_named or is_slow or is_same(found, expected), (said, found.rates)
