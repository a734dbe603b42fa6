"""The input of a search for rotor faults: gyro, accelerometer and motor commands, each at its own
rate, on one uniform grid of short intervals.

The mean angular acceleration over an interval is exactly the difference of the gyro at both ends.
Specific force and thrust are means over the same interval. No window of a derivative or filter
smears the time of a fault.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...runtime.arrays import Array, Mask
from ...runtime.errors import InputError
from ..logs.channels import Stream, readable
from ..logs.flight_log import FlightLog
from ..logs.flight_phases import usual_thrust
from ..logs.readers import px4_ulog
from ..logs.reading import READERS, reader_by_content
from ..logs.table import Data, Names, median_step
from ..motion.signals import LONGEST_GAP
from ..motion.smoothing import lagged

ORDER = 10  # the autoregression's, of the noise
STEP = 0.02  # s, grid: a rotor takes about as long to follow
FINE = 0.004  # s, grid of commands for the rotors' lag
SETTLED = 1.5  # s after the rotors first carry the vehicle, until it is off the ground
LEAST_SECONDS = 3.0  # in flight: a shorter one does not show the usual motion

SHORTEST = ORDER + 1  # unbroken intervals; the noise of a shorter run has no past
# an axis is clipped if it stays this long within this share of its magnitude, near the end of a
# usual range of gyros (moved a little by a calibration) or at the largest value of the log
CLIPPED_SECONDS, CLIPPED_SHARE = 0.04, 0.01
RANGES = np.array([250.0, 500.0, 1000.0, 2000.0]) * np.pi / 180.0  # rad/s
RANGE_SHARE = 0.08
IMPACT = 40.0  # m/s2 of specific force: the vehicle hit something


class Samples(NamedTuple):
    """The streams on the grid, while the vehicle flies and before it tumbles (N intervals), in this
    kit's axes and order of rotors.
    """

    name: str  # the log's
    t: Array  # (N,) s, middles
    angular_acceleration: Array  # (N, 3) rad/s2, means
    angular_velocity: Array  # (N, 3) rad/s, means
    specific_force: Array  # (N,) m/s2 along body z, means
    whole: Mask  # (N,) the ``ORDER`` intervals before are there, without a gap
    command: Stream  # (K, 4) in parts of the median while flying, each ``FINE``
    # (N,) possible error of the command between its own samples, in parts of the median: half of
    # the change from one to the next in the middle, nothing at either
    between: Array
    motor_names: Names  # the log's own, of rotors 1 to 4; or none
    ended: str | None  # reason for the end of the search; None: the log's end

    def thrust(self, lag: float, bend: float, dead: float) -> Array:
        """Return the rotors' relative thrusts (N, 4): 1 at the median command while flying.

        With ``x`` the command above ``dead``, 1 at the median, thrust is ``bend x^2 + (1 - bend)
        x``, as in PX4's THR_MDL_FAC.

        Args:
            lag: s, time constant of the rotors behind the command.
            bend: 0 for thrust linear in the command, to 1 for the square.
            dead: largest command without thrust, in parts of the median.
        """
        x = np.maximum(self.command.values - dead, 0.0) / (1.0 - dead)
        thrust = lagged(bend * x * x + (1.0 - bend) * x, lag, FINE)
        return _means(Stream("thrust", self.command.t, thrust), self.t)


def samples_of(log: FlightLog, path: Path | None = None) -> Samples:
    """Return a log's gyro, accelerometer, and commands (else rotor speeds) on the grid.

    Args:
        log: the log.
        path: its file: a PX4 file has the channels' own rates and clock, and names of the motors.

    Raises:
        InputError: one of the three is missing, or less than 3 s of flight.
    """
    name = log.source or log.name
    motors: Names = ()
    if path and reader_by_content(path) is READERS["px4_ulog"]:
        (log_map, streams, *_), _ = px4_ulog.channels(path, has_ranges=False)
        if log_map.commands:
            motors = tuple(f"PX4 motor {i}" for i in log_map.commands.order)
    else:
        command = log.rotor_speeds**2 if log.command is None else log.command
        # a held command changes at its own samples alone
        new = np.any(np.diff(command, axis=0, prepend=np.nan) != 0.0, axis=1)
        new[-1] = True
        streams = {"commands": Stream("commands", log.t[new], command[new])}
        for part in ("gyro", "accelerometer"):
            if (values := getattr(log, part)) is not None:
                streams[part] = Stream(part, log.t, values)
    parts = ("gyro", "accelerometer", "commands")
    found: Data = {part: readable(streams.get(part)) for part in parts}
    if missing := [part for part, stream in found.items() if stream is None]:
        raise InputError(
            f"{name}: no {' and no '.join(missing)}; expected all of gyro, accelerometer and "
            "motor commands, to look for a rotor that lost thrust"
        )
    return sample(name, **found, motor_names=motors)


def sample(
    name: str,
    gyro: Stream,
    accelerometer: Stream,
    commands: Stream,
    motor_names: Names = (),
) -> Samples:
    """Put streams on the grid.

    Raises:
        InputError: less than 3 s of flight.
    """
    from scipy.ndimage import binary_opening  # as late as can be: it takes .1 s

    times = gyro.t, accelerometer.t, commands.t
    edges = np.arange(max(at[0] for at in times), min(at[-1] for at in times), STEP)
    t = 0.5 * (edges[1:] + edges[:-1])
    total = commands.values.sum(axis=1)
    keep = np.interp(t, commands.t, total) > 0.5 * usual_thrust(total)
    for at in times[:2]:
        keep &= np.diff(at)[np.searchsorted(at, t) - 1] < LONGEST_GAP
    begin = t[keep].min(initial=np.inf) + SETTLED
    stop, ended = _end(gyro, accelerometer, begin)
    keep &= (t > begin) & (t < stop)
    keep = binary_opening(keep, np.ones(SHORTEST))
    if (seconds := keep.sum() * STEP) < LEAST_SECONDS:
        raise InputError(
            f"{name}: {seconds:.3g} s in flight with gyro, accelerometer and commands; expected "
            f"at least {LEAST_SECONDS:g} s without a gap of {LONGEST_GAP:g} s, to see what is usual"
        )
    rate, t = gyro.at(edges), t[keep]
    fine = np.arange(commands.t[0], commands.t[-1] + FINE, FINE)
    here, after = commands.at(t), np.searchsorted(commands.t, t)
    usual = np.median(here.mean(axis=1))
    off = np.abs((here - commands.values[after - 1]) * (commands.values[after] - here))
    return Samples(
        name,
        t,
        np.diff(rate, axis=0)[keep] / STEP,
        0.5 * (rate[1:] + rate[:-1])[keep],
        _means(accelerometer, t)[:, 2],
        (np.convolve(keep, np.ones(ORDER + 1))[: len(keep)] > ORDER)[keep],
        Stream("command", fine, commands.at(fine) / usual),
        np.sqrt(off).mean(axis=1) / usual,
        motor_names,
        ended or None,
    )


def _means(stream: Stream, middles: Array) -> Array:
    """Return the means (N, d) over the grid's intervals; values are linear between samples."""
    from scipy.interpolate import make_interp_spline

    integral = make_interp_spline(stream.t, stream.values, k=1).antiderivative()
    return np.asarray(integral(middles + 0.5 * STEP) - integral(middles - 0.5 * STEP)) / STEP


def _end(gyro: Stream, accelerometer: Stream, begin: float) -> tuple[float, str]:
    """Return the end of the model's validity, and its reason: a clipped gyro, or an impact after
    ``begin`` (s), since take-off may be hard.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    count = max(3, round(CLIPPED_SECONDS / median_step(gyro.t)))
    rate, size = gyro.values, np.abs(gyro.values)
    at_limit = np.abs(size[..., None] / RANGES - 1.0).min(axis=2) < RANGE_SHARE
    at_limit |= (size > (1.0 - CLIPPED_SHARE) * size.max(axis=0)) & (size > RANGES[0])
    spread = maximum_filter1d(rate, count, axis=0) - minimum_filter1d(rate, count, axis=0)
    clipped = np.any(at_limit & (spread < CLIPPED_SHARE * size), axis=1)
    # the filters look half their width to either side
    ends = gyro.t[: -(count // 2)][clipped[count // 2 :]]
    force = np.linalg.norm(accelerometer.values, axis=1)
    hits = accelerometer.t[(force > IMPACT) & (accelerometer.t > begin)] - STEP
    return min(
        (ends.min(initial=np.inf), "the gyro was at its limit"),
        (hits.min(initial=np.inf), "the vehicle hit something"),
        (np.inf, ""),
    )
