"""The input of a search for rotor faults: gyro, accelerometer and motor commands, each at its own
rate, on one uniform grid of short intervals.

The mean angular acceleration over an interval is exactly the difference of the gyro at both ends.
Specific force and thrust are means over the same interval. No window of a derivative or filter
smears the time of a fault.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.arrays import Array, Mask
from ...runtime.errors import InputError
from ..logs.channels import Stream, readable
from ..logs.flight_log import FlightLog
from ..logs.flight_phases import usual_thrust
from ..logs.readers import px4_ulog
from ..logs.reading import READERS, read_log, reader_by_content
from ..logs.table import Data, Names, median_step
from ..motion.smoothing import lagged, runs_of

_PX4 = "px4_ulog"  # the reader
_CHANNELS = ("gyro", "accelerometer", "commands")  # needed in a PX4 log
STEP = 0.02  # s, grid: a rotor takes about as long to follow
FINE = 0.004  # s, grid of commands for the rotors' lag
SETTLED = 1.5  # s after the rotors first carry the vehicle, until it is off the ground
LEAST_SECONDS = 3.0  # in flight: a shorter one does not show the usual motion
LONGEST_GAP = 0.1  # s without a sample; nothing is interpolated across a longer gap
SHORTEST = 0.2  # s of unbroken samples; the noise of a shorter run has no past
# an axis is clipped if it stays this long within this share of its magnitude, near the end of a
# usual range of gyros (moved a little by a calibration) or at the largest value of the log
CLIPPED_SECONDS, CLIPPED_SHARE = 0.04, 0.01
RANGES = np.array([250.0, 500.0, 1000.0, 2000.0]) * np.pi / 180.0  # rad/s
RANGE_SHARE = 0.08
IMPACT = 40.0  # m/s2 of specific force: the vehicle hit something


class Channels(NamedTuple):
    """The three streams, in this kit's axes and order of rotors."""

    name: str
    gyro: Stream  # (N, 3) rad/s, body
    accelerometer: Stream  # (M, 3) m/s2, body: +g along z in a hover
    command: Stream  # (K, 4) motor commands, in any unit growing with thrust, 0: none
    # the command is thrust itself but for a factor (rotor speeds squared): no curve is looked for
    thrust_known: bool = False
    motor_names: Names | None = None  # the log's own, of rotors 1 to 4


class Samples(NamedTuple):
    """The streams on the grid, while the vehicle flies and before it tumbles (N intervals)."""

    t: Array  # (N,) s, middles
    angular_acceleration: Array  # (N, 3) rad/s2, means
    angular_velocity: Array  # (N, 3) rad/s, means
    specific_force: Array  # (N,) m/s2 along body z, means
    follows: Mask  # (N,) the interval before is there too
    # (N,) possible error of the command between its own samples, in parts of the median: half of
    # the change from one to the next in the middle, nothing at either
    between: Array
    channels: Channels
    ended: str  # reason for the end of the search; empty: the log's end

    def thrust(self, lag: float, bend: float, dead: float) -> Array:
        """Return the rotors' relative thrusts (N, 4): 1 at the median command while flying.

        With ``x`` the command above ``dead``, 1 at the median, thrust is ``bend x^2 + (1 - bend)
        x``, as in PX4's THR_MDL_FAC.

        Args:
            lag: s, time constant of the rotors behind the command.
            bend: 0 for thrust linear in the command, to 1 for the square.
            dead: largest command without thrust, in parts of the median.
        """
        command = self.channels.command
        fine = np.arange(command.t[0], command.t[-1] + FINE, FINE)
        u = command.at(fine)
        u /= np.median(np.interp(self.t, fine, u.mean(axis=1)))
        x = np.maximum(u - dead, 0.0) / (1.0 - dead)
        return _means(fine, lagged(bend * x * x + (1.0 - bend) * x, lag, FINE), self.t)


def read_channels(
    path: Path,
    reader: str | None = None,
    vehicle: Vehicle | None = None,
    log_map: str | None = None,
    log: FlightLog | None = None,
) -> tuple[Channels, Names]:
    """Return a file's gyro, accelerometer and commands, and notes on their origin.

    A PX4 file alone has the channels' own rates. Other files go through their reader; ``log`` is a
    log already read.

    Raises:
        InputError: the file cannot be read, or lacks one of the three.
    """
    if log_map or reader not in (None, _PX4) or reader_by_content(path) is not READERS[_PX4]:
        log = log or read_log(path, reader, vehicle, log_map)
        return channels_of_log(log), log.notes
    (log_map_of, channels, _, notes), _ = px4_ulog.channels(path, has_ranges=False)
    streams: Data = {part: readable(channels.get(part)) for part in _CHANNELS}
    if missing := [part for part, stream in streams.items() if stream is None]:
        raise InputError(f"{path}: no {' and no '.join(missing)}; expected all of them")
    assert log_map_of.commands is not None
    names = tuple(f"PX4 motor {i}" for i in log_map_of.commands.order)
    gyro, accelerometer, command = streams.values()
    return Channels(str(path), gyro, accelerometer, command, motor_names=names), tuple(notes)


def channels_of_log(log: FlightLog) -> Channels:
    """Return the streams of a log in the kit's format: commands if any, else rotor speeds.

    Raises:
        InputError: gyro, accelerometer, or both commands and rotor speeds are missing.
    """
    name, command = log.source or log.name, log.command
    if log.gyro is None or log.accelerometer is None:
        raise InputError(
            f"{name}: no gyro or no accelerometer; expected gx, gy, gz and ax, ay, az, to look for "
            "a rotor that lost thrust"
        )
    if command is None:
        if not log.has_rotor_speeds:
            raise InputError(f"{name}: no motor commands and no rotor speeds; expected one of them")
        command = np.square(log.rotor_speeds)
    # a held command changes at its own samples alone
    new = np.any(np.diff(command, axis=0, prepend=np.nan) != 0.0, axis=1)
    new[-1] = True
    return Channels(
        name,
        Stream("gyro", log.t, log.gyro).whole(),
        Stream("accelerometer", log.t, log.accelerometer).whole(),
        Stream("commands", log.t[new], command[new]),
        thrust_known=log.command is None,
    )


def sample(channels: Channels) -> Samples:
    """Put the streams on the grid.

    Raises:
        InputError: fewer than 3 s of flight, or too few samples a second.
    """
    times = channels.gyro.t, channels.accelerometer.t, channels.command.t
    if min(map(len, times)) < 10:
        raise InputError(
            f"{channels.name}: fewer than ten samples of gyro, accelerometer or commands"
        )
    for what, at in zip(_CHANNELS[:2], times, strict=False):
        if (step := median_step(at)) > LONGEST_GAP:
            raise InputError(
                f"{channels.name}: {what}: {1.0 / step:.3g} samples a second; expected at least "
                f"{1.0 / LONGEST_GAP:g}, to see a rotor fail"
            )
    edges = np.arange(max(at[0] for at in times), min(at[-1] for at in times), STEP)
    if len(edges) < 3:
        raise InputError(
            f"{channels.name}: gyro, accelerometer and commands do not overlap in time"
        )
    t = 0.5 * (edges[1:] + edges[:-1])
    gyro = channels.gyro.at(edges)
    force = _means(channels.accelerometer.t, channels.accelerometer.values, t)
    total = channels.command.values.sum(axis=1)
    keep = np.interp(t, channels.command.t, total) > 0.5 * usual_thrust(total)
    for at in times[:2]:
        keep &= np.diff(at)[np.searchsorted(at, t) - 1] < LONGEST_GAP
    begin = t[keep].min(initial=np.inf) + SETTLED
    stop, why = _end(channels, begin)
    keep &= (t > begin) & (t < stop)
    for a, b in runs_of(keep):
        keep[a:b] = (b - a) * STEP > SHORTEST
    if keep.sum() * STEP < LEAST_SECONDS:
        raise InputError(
            f"{channels.name}: {keep.sum() * STEP:.3g} s in flight; expected at least "
            f"{LEAST_SECONDS:g} s without a gap, to see what is usual"
        )
    return Samples(
        t[keep],
        (np.diff(gyro, axis=0) / STEP)[keep],
        (0.5 * (gyro[1:] + gyro[:-1]))[keep],
        force[keep, 2],
        np.append(False, keep[:-1])[keep],
        _between(channels.command, t[keep]),
        channels,
        why,
    )


def _between(command: Stream, t: Array) -> Array:
    """Return the command's possible error between its samples (N,); see ``Samples``."""
    before = np.searchsorted(command.t, t) - 1
    step = np.diff(command.t)[before]
    part = (t - command.t[before]) / step
    change = np.abs(np.diff(command.values, axis=0)[before]).mean(axis=1)
    usual = np.median(np.interp(t, command.t, command.values.mean(axis=1)))
    return np.where(step > 1.5 * STEP, change / usual * np.sqrt(part * (1.0 - part)), 0.0)


def _means(times: Array, values: Array, middles: Array) -> Array:
    """Return the means (N, d) over the grid's intervals; values are linear between ``times``."""
    from scipy.interpolate import make_interp_spline

    integral = make_interp_spline(times, values, k=1).antiderivative()
    return np.asarray(integral(middles + 0.5 * STEP) - integral(middles - 0.5 * STEP)) / STEP


def _end(c: Channels, begin: float) -> tuple[float, str]:
    """Return the end of the model's validity, and its reason: a clipped gyro, or an impact after
    ``begin`` (s), since take-off may be hard.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    count = max(3, round(CLIPPED_SECONDS / median_step(c.gyro.t)))
    rate, size = c.gyro.values, np.abs(c.gyro.values)
    at_limit = np.abs(size[..., None] / RANGES - 1.0).min(axis=2) < RANGE_SHARE
    at_limit |= (size > (1.0 - CLIPPED_SHARE) * size.max(axis=0)) & (size > RANGES[0])
    spread = maximum_filter1d(rate, count, axis=0) - minimum_filter1d(rate, count, axis=0)
    clipped = np.any(at_limit & (spread < CLIPPED_SHARE * size), axis=1)
    # the filters look half their width to either side
    ends = c.gyro.t[np.maximum(np.flatnonzero(clipped) - count // 2, 0)]
    times, force = c.accelerometer.t, np.linalg.norm(c.accelerometer.values, axis=1)
    hits = times[(force > IMPACT) & (times > begin)] - STEP
    return min(
        (ends.min(initial=np.inf), "the gyro was at its limit"),
        (hits.min(initial=np.inf), "the vehicle hit something"),
        (np.inf, ""),
    )
