"""A closed loop in any winds, along any reference, with an accelerometer beside it.

The winds are evaluated at the stations of the vehicle 100 times a second; drag at the stations
makes force and torque of them, as of the fan's jet.
"""

import math
from collections.abc import Sequence

import numpy as np
from numba import carray, types

from ..controllers.flight import FlightGains, fly, move_setpoint
from ..controllers.model_inverse import foresee, through_the_rotors
from ..dynamics.mean_jet import COUNT_R, COUNT_X
from ..dynamics.motion import Array
from ..dynamics.rotation import quaternion_to_matrix
from ..dynamics.vehicle import Vehicle
from ..estimator.tuning import UKFTuning
from ..runtime.addresses import address_of, call_at, call_step, numbers_at, pointer_to
from ..runtime.compiled import Record, compiled, compiled_without_gil, specialised
from ..runtime.errors import InputError
from .closed_loop import FASTEST, LOOP, ClosedLoop
from .fan import STATIONS, Fan
from .plant import NOISE, SUBSTEPS, TICK, PlantSettings, actuate, sense
from .wind.field import CompiledWind, check_compiled, winds_of

WINDY_NOISE = NOISE + 3  # unit normals that one tick uses, those of the accelerometer last
WIND_EVERY = 2  # ticks over which the winds at the stations are held
REFERENCE_SIZE = 10  # position, velocity, acceleration, yaw

WINDY = np.dtype(
    [
        # addresses: of the loop's record, of (winds, 2) function and record, of the reference
        # (rows, REFERENCE_SIZE), and of the fan's path (rows, 2) y and z in m
        *[(name, "i8") for name in ("loop", "winds", "reference", "path")],
        *[(name, "i8") for name in ("wind_count", "reference_count", "path_count")],
        ("ticks", "i8"),  # since the episode's start; below zero before it
        ("time", "f8", (1,)),  # s, of the winds
        ("points", "f8", (3, STATIONS)),
        ("air", "f8", (3, STATIONS)),
        ("rotation", "f8", (3, 3)),
        ("action", "f8", (3,)),  # m/s2, beside the flight loop's own
        ("model_in_loop", "i8"),  # whether the flight loop counters the effects of its model
        ("sigma", "f8"),  # m/s2, of the accelerometer, a tick
        ("bias", "f8", (3,)),  # m/s2, of the accelerometer, body axes
        # m/s2, world, mean over the last run: specific force as the accelerometer has it, and that
        # of the rotors by the model
        ("specific", "f8", (3,)),
        ("thrust", "f8", (3,)),
    ]
)


@compiled
def _blow(w: Record, loop: Record, qpos: Array) -> None:
    """Write the winds at the stations into ``loop.fan.air``."""
    R, s = w.rotation, loop.fan.stations
    quaternion_to_matrix(qpos[3:7], R)
    for i in range(STATIONS):
        for a in range(3):
            w.points[a, i] = qpos[a] + R[a, 0] * s[i, 0] + R[a, 1] * s[i, 1] + R[a, 2] * s[i, 2]
            w.air[a, i] = 0.0
    w.time[0] = max(w.ticks, 0) * TICK
    calls = carray(pointer_to(w.winds), (w.wind_count, 2), np.int64)
    for n in range(w.wind_count):
        call_at(
            calls[n, 0],
            calls[n, 1],
            STATIONS,
            w.time.ctypes.data,
            w.points.ctypes.data,
            w.air.ctypes.data,
        )
    for i in range(STATIONS):
        for a in range(3):
            loop.fan.air[i, a] = w.air[a, i]


@compiled
def _windy_tick(
    w: Record,
    loop: Record,
    axial: Array,
    radial: Array,
    qpos: Array,
    qvel: Array,
    xfrc: Array,
    noise: Array,
) -> None:
    plant, ukf, flight = loop.plant, loop.filter, loop.flight
    plant.seen = sense(plant, qpos, noise)
    for i in range(len(ukf.z)):
        ukf.z[i] = plant.z[i]
    call_step(loop.step, ukf, plant.seen, TICK, plant.battery)
    if w.reference_count > 0:
        rows = numbers_at(w.reference, (w.reference_count, REFERENCE_SIZE))
        k = min(max(w.ticks, 0), w.reference_count - 1)
        for i in range(REFERENCE_SIZE):
            flight.setpoint[i] = rows[k, i]
    else:
        move_setpoint(flight, ukf.x, TICK)
    for i in range(3):
        flight.setpoint[6 + i] += w.action[i]
    if w.model_in_loop > 0:
        foresee(flight, ukf, ukf.x)
    fly(flight, ukf.x, TICK)
    if w.model_in_loop > 0:
        through_the_rotors(flight, ukf)
    for i in range(3):
        flight.setpoint[6 + i] -= w.action[i]
    if w.path_count > 0:
        path = numbers_at(w.path, (w.path_count, 2))
        k = min(max(w.ticks, 0), w.path_count - 1)
        loop.fan.y, loop.fan.height = path[k, 0], path[k, 1]
    if w.wind_count > 0 and w.ticks % WIND_EVERY == 0:
        _blow(w, loop, qpos)
    actuate(plant, flight.command, loop.fan, axial, radial, qpos, qvel, noise, xfrc)
    # what an accelerometer in the centre of mass feels of this tick's wrench, turned into the world
    # by the estimated attitude, and what the rotors make of it by the declared model
    R, E, body = plant.rotation, flight.rotation, flight.body
    push = 0.0
    for i in range(4):
        push += body.k[i] * plant.z[i] * plant.z[i]
    for j in range(3):
        felt = w.bias[j] + w.sigma * noise[NOISE + j]
        for i in range(3):
            felt += R[i, j] * xfrc[i] / plant.body.mass
        for i in range(3):
            w.specific[i] += E[i, j] * felt
        w.thrust[j] += E[j, 2] * push / body.mass


def _run(address: int, noise: int, count: int) -> None:
    """Run ``count`` ticks with the normals (count, WINDY_NOISE) that lie at ``noise``."""
    w = carray(pointer_to(address), 1, WINDY)[0]
    loop = carray(pointer_to(w.loop), 1, LOOP)[0]
    loop.ticks += count
    axial = numbers_at(loop.axial, (COUNT_X, COUNT_R))
    radial = numbers_at(loop.radial, (COUNT_X, COUNT_R))
    qpos, qvel = numbers_at(loop.qpos, (7,)), numbers_at(loop.qvel, (6,))
    xfrc, counted = numbers_at(loop.xfrc, (6,)), numbers_at(loop.counted, (1,))
    normals = numbers_at(noise, (count, WINDY_NOISE))
    for i in range(3):
        w.specific[i] = w.thrust[i] = 0.0
    for k in range(count):
        _windy_tick(w, loop, axial, radial, qpos, qvel, xfrc, normals[k])
        counted[0] += 1.0
        for _ in range(SUBSTEPS):
            call_at(loop.mj_step, loop.model, loop.data)
        w.ticks += 1
    for i in range(3):
        w.specific[i] /= count
        w.thrust[i] /= count


_RUN = types.void(*[types.int64] * 3)


@compiled_without_gil
def _run_rows(run: int, windy: int, noise: Array) -> None:
    call_at(run, windy, noise.ctypes.data, len(noise))


class WindyFlight:
    """One vehicle in closed loop in winds that may be changed from episode to episode.

    Args:
        declared: the vehicle as filter and flight loop know it.
        true: the vehicle as it is.
        fan: what drag it has; the jet of this fan blows beside the winds unless its speed is 0.
        tuning: of the filter.
        settings: of the plant.
        gains: of the flight loop.
        drawn: whether the world has what is there for the eye alone.
        estimator: ``ukf`` or ``constant-gain``.
        accelerometer: standard deviation in m/s2 of its noise, a tick, and of its bias.
        model_in_loop: whether the flight loop counters the effects that ``declared`` has.
    """

    def __init__(
        self,
        declared: Vehicle,
        true: Vehicle | None = None,
        fan: Fan | None = None,
        tuning: UKFTuning | None = None,
        settings: PlantSettings | None = None,
        gains: FlightGains | None = None,
        drawn: bool = False,
        estimator: str = "ukf",
        accelerometer: tuple[float, float] = (0.0, 0.0),
        model_in_loop: bool = False,
    ) -> None:
        self.loop = ClosedLoop(
            declared,
            true,
            tuning,
            fan or Fan(speed=0.0),
            settings,
            gains,
            drawn=drawn,
            estimator=estimator,
        )
        self.record = np.zeros(1, dtype=WINDY)
        self.address = int(self.record.ctypes.data)
        w = self.record[0]
        w["loop"] = self.loop.address
        w["sigma"], self._sigma_bias = accelerometer
        w["model_in_loop"] = model_in_loop
        self.action: Array = w["action"]
        self.specific: Array = w["specific"]
        self.thrust: Array = w["thrust"]
        self.air: Array = w["air"]  # (3, STATIONS) m/s
        self._run = address_of(_run, _RUN)
        self._call = specialised(_run_rows, 0, 0, np.empty((0, WINDY_NOISE)))
        self._kept: tuple[object, ...] = ()

    def reset(
        self,
        rng: np.random.Generator,
        position: Array,
        yaw: float = 0.0,
        winds: Sequence[CompiledWind] = (),
        reference: Array | None = None,
        path: Array | None = None,
        settle: int = 0,
    ) -> None:
        """Hover at ``position`` (3,) m and ``yaw`` rad.

        Args:
            rng: what the start is drawn from.
            position: of the geometric centre.
            yaw: rad.
            winds: what blows, at its time 0 until the episode begins.
            reference: (n, REFERENCE_SIZE), a row a tick; default: the set point stays where it is,
                and moves with the velocity that it is given.
            path: (n, 2) m, the fan's y and height, a row a tick.
            settle: ticks before the episode begins; even, so that the winds blow from the first.

        Raises:
            InputError: a wind that is not compiled, or another shape.
        """
        for wind in winds:
            check_compiled(wind, "WindyFlight")
        parts = [part for wind in winds for part in winds_of(wind)]
        calls = np.array(
            [[part.address, part.record.ctypes.data] for part in parts], dtype=np.int64
        ).reshape(-1, 2)
        rows = _table(reference, REFERENCE_SIZE, "reference")
        places = _table(path, 2, "path")
        loop, w = self.loop.record[0], self.record[0]
        self._kept = parts, calls, rows, places
        for name, count, array in (
            ("winds", "wind_count", calls),
            ("reference", "reference_count", rows),
            ("path", "path_count", places),
        ):
            w[name], w[count] = array.ctypes.data, len(array)
        self.action[:] = 0.0
        w["bias"] = self._sigma_bias * rng.standard_normal(3)
        w["ticks"] = -settle
        self.loop.reset(rng, position, yaw)
        loop["fan"]["air"], loop["fan"]["blown"] = 0.0, 1  # drag, in still air too
        if settle > 0:
            self.run(rng.standard_normal((settle, WINDY_NOISE)))

    def run(self, noise: Array) -> None:
        """Run one tick for each row of ``noise`` (n, WINDY_NOISE), unit normals, n from 1 on."""
        self._call(self._run, self.address, noise)

    def healthy(self) -> bool:
        """Whether it still flies: as ``ClosedLoop.healthy``, and a little quicker."""
        loop = self.loop
        counted = float(loop.data.userdata[0]) >= float(loop.record["ticks"][0])
        return (
            counted
            and math.isfinite(sum(loop.state.tolist()[:19]))
            and all(abs(v) < FASTEST for v in loop.motion[1].tolist())
        )

    @property
    def ticks(self) -> int:
        """Ticks since the episode's start."""
        return int(self.record["ticks"][0])


def _table(given: Array | None, columns: int, name: str) -> Array:
    if given is None:
        return np.zeros((0, columns))
    table = np.ascontiguousarray(given, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != columns or not np.all(np.isfinite(table)):
        raise InputError(
            f"WindyFlight: {name} must be finite numbers, shape (n, {columns}), got shape "
            f"{table.shape}"
        )
    return table
