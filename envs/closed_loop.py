"""Plant, wrench filter and flight loop together: a vehicle that flies to a set point and feels the
wind.
"""

import math
from contextlib import nullcontext
from functools import cache
from typing import NoReturn

import mujoco
import numpy as np
from numba import carray, types

from ..controllers.flight import (
    FLIGHT,
    FlightGains,
    flight_record,
    fly,
    move_setpoint,
    reset_flight,
)
from ..dynamics.effects import compile_effects
from ..dynamics.mean_jet import COUNT_R, COUNT_X
from ..dynamics.motion import Array
from ..dynamics.rotation import quaternion_of_yaw
from ..dynamics.vehicle import Vehicle
from ..estimator.constant_gain import ConstantGainFilter
from ..estimator.filter_record import FILTER
from ..estimator.tuning import UKFTuning
from ..estimator.ukf import WrenchUKF, correct_parts
from ..runtime.addresses import address_of, call_at, call_step, numbers_at, pointer_to
from ..runtime.compiled import (
    Record,
    compiled,
    compiled_meanwhile,
    compiled_without_gil,
    specialised,
)
from ..runtime.errors import InputError, unknown_name
from .fan import FAN, Fan, fan_record, jet_table
from .plain_steps import step_of
from .plant import (
    NOISE,
    PLANT,
    SUBSTEPS,
    TICK,
    PlantSettings,
    actuate,
    load_world,
    plant_record,
    reset_plant,
    sense,
)
from .suspended_load import SuspendedLoad, hang, pull, set_down

FASTEST = 200.0  # m/s and rad/s; a vehicle is not
_AT_REST = np.zeros(1)
_STILL_AIR = (np.zeros((COUNT_X, COUNT_R)),) * 2
LOOP = np.dtype(
    [
        ("plant", PLANT),
        ("filter", FILTER),
        ("step", "i8"),
        ("flight", FLIGHT),
        ("fan", FAN),
        ("ticks", "i8"),  # since the reset
        # addresses: of the jet's tables, of MuJoCo's step and its arguments, and of arrays in its
        # data; ``counted`` is its user's array, in which the ticks are counted once more
        *[
            (name, "i8")
            for name in (
                "axial",
                "radial",
                "mj_step",
                "model",
                "data",
                "qpos",
                "qvel",
                "xfrc",
                "counted",
            )
        ],
    ]
)

# what estimates the wrench in flight
ESTIMATORS: dict[str, type[WrenchUKF]] = {"ukf": WrenchUKF, "constant-gain": ConstantGainFilter}


@compiled
def tick(
    loop: Record, axial: Array, radial: Array, qpos: Array, qvel: Array, xfrc: Array, noise: Array
) -> None:
    """Sense, estimate, steer and actuate once; MuJoCo's ``xfrc`` (6,) then holds the wrench of this
    tick.

    ``noise`` (NOISE,) are unit normals. Everything that changes lies in ``loop`` and the arrays
    given.
    """
    plant, ukf, flight = loop.plant, loop.filter, loop.flight
    plant.seen = sense(plant, qpos, noise)
    for i in range(len(ukf.z)):
        ukf.z[i] = plant.z[i]
    call_step(loop.step, ukf, plant.seen, TICK, plant.battery)
    move_setpoint(flight, ukf.x, TICK)
    fly(flight, ukf.x, TICK)
    actuate(plant, flight.command, loop.fan, axial, radial, qpos, qvel, noise, xfrc)


def _run(address: int, noise: int, count: int, fan_y: int, fan_count: int, first: int) -> None:
    """Run ``count`` ticks of the loop whose record lies at ``address``.

    ``noise`` and ``fan_y`` are the addresses of normals (count, NOISE) and of the fan's path
    (fan_count,) in m, of which ``first`` is this first tick's place; after its end the fan stands
    still.
    """
    loop = carray(pointer_to(address), 1, LOOP)[0]
    # first of all: a run that does not come to its end lags behind it, as one that MuJoCo reset
    # does
    loop.ticks += count
    axial, radial = (
        numbers_at(loop.axial, (COUNT_X, COUNT_R)),
        numbers_at(loop.radial, (COUNT_X, COUNT_R)),
    )
    qpos, qvel, xfrc = (
        numbers_at(loop.qpos, (7,)),
        numbers_at(loop.qvel, (6,)),
        numbers_at(loop.xfrc, (6,)),
    )
    counted = numbers_at(loop.counted, (1,))
    normals, path = numbers_at(noise, (count, NOISE)), numbers_at(fan_y, (fan_count,))
    for k in range(count):
        loop.fan.y = path[min(first + k, fan_count - 1)]
        tick(loop, axial, radial, qpos, qvel, xfrc, normals[k])
        counted[0] += 1.0
        for _ in range(SUBSTEPS):
            call_at(loop.mj_step, loop.model, loop.data)


_RUN = types.void(*[types.int64] * 6)


@cache
def run_address() -> int:
    """Return the address of ``_run``, compiled now if it was not: one machine code for all that run
    loops.
    """
    return address_of(_run, _RUN)


@compiled_without_gil
def _run_rows(run: int, loop: int, noise: Array, fan_y: Array, first: int) -> None:
    """Run one tick for each row of ``noise``."""
    call_at(run, loop, noise.ctypes.data, len(noise), fan_y.ctypes.data, len(fan_y), first)


def compile_run() -> None:
    """Compile the correction, which the filter's step compiles last, and the loop: half of what a
    first flight needs.
    """
    specialised(correct_parts, np.zeros(1, dtype=FILTER)[0], np.zeros(1), 3)
    run_address()


@compiled
def has_been_reset(loop: Record) -> bool:
    """Return whether MuJoCo reset the vehicle on its own: it does so, silently in code, where a
    state is not finite, and sets the ticks that its data count to zero with everything else.
    """
    late: bool = numbers_at(loop.counted, (1,))[0] < loop.ticks
    return late


class ClosedLoop:
    """One vehicle in closed loop with its estimate, ticked at 200 Hz.

    Args:
        declared: the vehicle as filter and flight loop know it.
        true: the vehicle as it is, with the effects that nobody declared; default: as declared.
        tuning: of the filter; default ``UKFTuning.for_vehicle(declared)``.
        fan: the jet it flies in, or None for still air without drag.
        settings: of the plant.
        gains: of the flight loop.
        load: a body that ``hang_load`` hangs on; default: none.
        drawn: whether the world has what is there for the eye alone.
        estimator: one of ``ESTIMATORS``.

    Raises:
        InputError: no estimator has this name.
    """

    def __init__(
        self,
        declared: Vehicle,
        true: Vehicle | None = None,
        tuning: UKFTuning | None = None,
        fan: Fan | None = None,
        settings: PlantSettings | None = None,
        gains: FlightGains | None = None,
        load: SuspendedLoad | None = None,
        drawn: bool = False,
        estimator: str = "ukf",
    ) -> None:
        if estimator not in ESTIMATORS:
            raise unknown_name("estimator", estimator, ESTIMATORS)
        plant, self._body = plant_record(
            declared if true is None else true, settings or PlantSettings()
        )
        self.model, self.data = load_world(self._body, load, drawn)
        self._step = step_of(self.model, self.data)
        self.jet_table = jet_table(fan.radius, fan.hub_radius) if fan else _STILL_AIR
        self.record = np.zeros(1, dtype=LOOP)
        self.address = int(
            self.record.ctypes.data
        )  # of the record, for compiled code; good for as long as this loop lives
        loop = self.record[0]
        loop["plant"] = plant[0]
        # the flight loop's model has no effects but those of the body: mass, inertia and its centre
        loop["flight"] = flight_record(compile_effects(declared).vehicle, gains)[0]
        if fan is not None:
            loop["fan"] = fan_record(fan, self._body.positions, TICK)[0]
        self._load = load
        self._body_id = self.model.body("vehicle").id
        first = run_address.cache_info().currsize == 0
        with compiled_meanwhile(tick, compile_run) if first else nullcontext():
            self.ukf = ESTIMATORS[estimator](declared, tuning, TICK)
            loop["step"] = self.ukf.step_address
        self._run = run_address()
        self._call = specialised(_run_rows, self._run, 0, np.empty((0, NOISE)), _AT_REST, 0)
        loop["filter"] = self.ukf.record[0]
        self._views()

    def _views(self) -> None:
        self._qpos: Array = self.data.qpos
        self._qvel: Array = self.data.qvel
        self._xfrc: Array = self.data.xfrc_applied[self._body_id]
        loop = self.record[0]
        self.state: Array = loop["filter"][
            "x"
        ]  # (20,) estimated state, laid out as in estimator.estimate
        self.covariance: Array = loop["filter"]["P"]
        self.setpoint: Array = loop["flight"]["setpoint"]
        self.external: Array = loop["plant"]["external"]  # (6,) true external wrench, world
        self.jet: Array = loop["plant"]["jet"]  # (6,) parts of it: of the jet,
        self.disturbance: Array = loop["plant"][
            "disturbance"
        ]  # (6,) of the actuators' unmodelled disturbance,
        self.applied: Array = loop["plant"][
            "applied"
        ]  # (6,) and that a user applies; zero after a reset
        self.sample: Array = loop["plant"]["z"]  # (11,) rotor speeds, position, quaternion
        self.unrounded: Array = loop["plant"]["sample"][
            :4
        ]  # (4,) these rotor speeds before they are rounded
        loop["mj_step"], loop["model"], loop["data"] = self._step[:3]
        for name, array in (
            ("qpos", self._qpos),
            ("qvel", self._qvel),
            ("xfrc", self._xfrc),
            ("counted", self.data.userdata),
            ("axial", self.jet_table[0]),
            ("radial", self.jet_table[1]),
        ):
            loop[name] = array.ctypes.data

    @property
    def motion(self) -> tuple[Array, Array]:
        """MuJoCo's generalised position and velocity: the vehicle's are the first (7,) and (6,)."""
        return self._qpos, self._qvel

    @property
    def position(self) -> Array:
        """True position (3,) of the geometric centre, m, world."""
        return self._qpos[:3]

    @property
    def quaternion(self) -> Array:
        """True attitude (4,), body to world."""
        return self._qpos[3:7]

    @property
    def velocity(self) -> Array:
        """True velocity (3,), m/s, world."""
        return self._qvel[:3]

    @property
    def seen(self) -> bool:
        """Whether the last sample held a pose."""
        return bool(self.record[0]["plant"]["seen"])

    @property
    def battery(self) -> float:
        """Battery voltage, V; 0 where the vehicle states no reference."""
        return float(self.record[0]["plant"]["battery"])

    @property
    def time(self) -> float:
        """Time since the reset, s."""
        return int(self.record["ticks"][0]) * TICK

    def reset(self, rng: np.random.Generator, position: Array, yaw: float = 0.0) -> None:
        """Hover at ``position`` (3,) m and ``yaw`` rad, with the filter started from one measured
        pose.
        """
        mujoco.mj_resetData(self.model, self.data)
        self._views()
        loop = self.record[0]
        loop["ticks"] = 0
        reset_plant(loop["plant"], self._body)
        self._qpos[:3], self._qpos[3:7] = position, quaternion_of_yaw(yaw)
        self.setpoint[:] = 0.0
        self.setpoint[:3], self.setpoint[9] = position, yaw
        reset_flight(loop["flight"])
        loop["fan"]["gusts"] = loop["fan"]["mixing"] @ rng.standard_normal(
            (len(loop["fan"]["gusts"]), 3)
        )
        noise = rng.standard_normal(NOISE)
        sense(self.record[0:1]["plant"][0], self._qpos, noise)
        self.ukf.reset(self.sample[4:7], self.sample[7:11])
        loop["filter"] = self.ukf.record[0]
        if self._load is not None:
            set_down(self.model, self.data, self._load)
        mujoco.mj_forward(self.model, self.data)

    def hang_load(self) -> None:
        """Hang the load on: at rest below its anchor on the taut thread.

        Raises:
            InputError: this loop was made without a load.
        """
        if self._load is None:
            raise InputError(
                "ClosedLoop: there is no load to hang on; give one with load=SuspendedLoad(...)"
            )
        hang(self.model, self.data, self._load)

    def load_pull(self) -> Array:
        """Return the true force (N) and torque (Nm) about the centre of mass, (6,) world, of a load
        on the vehicle.
        """
        return pull(self.data, self._body.com)

    def run(self, noise: Array, fan_y: Array | None = None, first: int = 0) -> None:
        """Run one tick for each row of ``noise`` (n, NOISE), all of them in one compiled call that
        lets other threads run.

        Args:
            noise: unit normals.
            fan_y: (m,) m, where the fan is tick by tick; after the last it stands still. Default:
                at 0.
            first: the first tick's place in ``fan_y``.

        Raises:
            InputError: a shape is wrong.
        """
        noise = np.ascontiguousarray(noise, dtype=np.float64)
        fan_y = _AT_REST if fan_y is None else np.ascontiguousarray(fan_y, dtype=np.float64)
        if (
            noise.ndim != 2
            or noise.shape[1] != NOISE
            or fan_y.ndim != 1
            or len(fan_y) == 0
            or first < 0
        ):
            raise InputError(
                f"ClosedLoop: expected noise (n, {NOISE}), fan_y (m,) and first from 0 on; got "
                f"shapes "
                f"{noise.shape}, {fan_y.shape} and first = {first}"
            )
        self._call(self._run, self.address, noise, fan_y, first)

    @property
    def was_reset(self) -> bool:
        """Whether MuJoCo reset the vehicle on its own: it does so, silently in code, where a state
        is not finite.
        """
        return bool(has_been_reset(self.record[0]))

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied or pickled: compiled code knows its arrays by address, and the copy
        would fly this one's.

        Raises:
            InputError: always.
        """
        raise InputError(
            "a flight cannot be copied or pickled; make another environment, reset it with the "
            "same seed and fly "
            "the same actions: it arrives at the same state"
        )

    def healthy(self) -> bool:
        """Whether it still flies: every number of plant and filter finite, and nothing faster than
        a vehicle can be.
        """
        return (
            math.isfinite(sum(self.state.tolist()[:19]))
            and all(abs(v) < FASTEST for v in self._qvel.tolist())
            and not self.was_reset
        )
