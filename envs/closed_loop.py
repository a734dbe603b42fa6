"""Plant, wrench filter and flight loop together: a vehicle that flies along a reference in wind.

A tick takes 5 ms and is a pipeline of named stages, ``STAGES``:

| stage      | reads                                  | writes                                     |
| ---------- | -------------------------------------- | ------------------------------------------ |
| `wind`     | `position`, `time`                     | `air`: every second tick, where winds blow |
| `sense`    | `position`, `quaternion`               | `sample`: pose and logged rotor speeds     |
| `estimate` | `sample`                               | `state`: pose, twist and external wrench   |
| `steer`    | `state`, `setpoint`, `action`          | `command`: rotor speeds                    |
| `actuate`  | `command`, `air`, `applied`            | `external`, and MuJoCo's wrench            |
| `move`     | MuJoCo's wrench                        | `position`, `quaternion`, `velocity`       |

A user's ``Stage`` runs before one of these stages.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco import _functions

from .. import _core
from ..controllers.flight import BESIDE, FLIGHT, FlightGains, flight_record, reset_flight
from ..dynamics.effects import compile_effects
from ..dynamics.effects.own import raise_errors
from ..dynamics.mean_jet import COUNT_R, COUNT_X, jet_table
from ..dynamics.model import lay_addresses, without_addresses
from ..dynamics.rotation import quaternion_of_yaw
from ..dynamics.vehicle import Vehicle
from ..estimator.constant_gain import ConstantGainFilter
from ..estimator.tuning import UKFTuning
from ..estimator.ukf import WrenchUKF
from ..runtime.arrays import Array
from ..runtime.errors import InputError, unknown_name
from .fan import FAN, STATIONS, Fan, fan_record
from .plant import (
    NOISE,
    PLANT,
    SUBSTEPS,
    TICK,
    PlantSettings,
    is_same_body,
    load_world,
    plant_record,
    reset_plant,
)
from .state import REFERENCE_SIZE
from .untimed import Untimed
from .wind.field import Sum, Wind

WIND_EVERY = 2  # ticks between two evaluations of the winds at the stations
ACCELEROMETER_NOISE = 3  # unit normals of a tick with an accelerometer, behind the plant's

LOOP = np.dtype(
    [
        ("plant", PLANT),
        ("flight", FLIGHT),
        ("fan", FAN),
        ("action", "f8", (4,)),  # the command, of a kind of ``controllers.flight``
        ("accelerometer_sigma", "f8"),  # m/s2, a tick
        ("accelerometer_bias", "f8", (3,)),  # m/s2, body axes
        # m/s2, world, mean over the last run: specific force of the accelerometer, and of the
        # rotors by the declared model
        ("specific", "f8", (3,)),
        ("thrust", "f8", (3,)),
        ("ticks", "i8"),  # since the start of the episode; below zero while the filter settles
        ("kind", "i8"),  # commands
        ("model_in_loop", "i8"),  # whether the flight loop counters the effects of its model
        ("points", "f8", (3, STATIONS)),  # m, world, the vehicle's stations in the last winds
        ("air", "f8", (3, STATIONS)),  # m/s, world, the winds there
        # addresses: the filter and its step; MuJoCo's pose, velocity and applied wrench; the jet's
        # table; the reference; the core's winds. Numbers of winds. MuJoCo's step, model and data
        *[(name, "i8") for name in ("filter", "step", "qpos", "qvel", "xfrc", "jet")],
        *[(name, "i8") for name in ("reference", "rows", "winds", "wind_count", "blowing")],
        *[(name, "i8") for name in ("mujoco_step", "model", "data")],
    ]
)
assert LOOP.itemsize == _core.LOOP_SIZE, "the core was built for another layout"
_ADDRESSES = (LOOP.names or ())[-14:]
# stages of the core
WIND, SENSE, ESTIMATE, STEER, ACTUATE, FEEL = range(6)
# callbacks of a user's own in a step: Python's errors would end the process in MuJoCo's function
_CALLBACKS = [
    getattr(mujoco, f"get_mjcb_{name}")
    for name in ("control", "passive", "act_dyn", "act_gain", "act_bias", "sensor")
]
# MuJoCo's own function
_MUJOCO_STEP = ctypes.cast(ctypes.CDLL(_functions.__file__).mj_step, ctypes.c_void_p).value

# estimators of the wrench in flight
ESTIMATORS: dict[str, type[WrenchUKF]] = {"ukf": WrenchUKF, "constant-gain": ConstantGainFilter}


_NO_JET: Array = np.zeros((2, COUNT_X, COUNT_R))


@lru_cache(maxsize=8)
def _jet(radius: float, hub_radius: float) -> Array:
    """Return the tables (2, COUNT_X, COUNT_R) of axial and radial speed, one for all loops."""
    return np.stack(jet_table(radius, hub_radius))


class World(NamedTuple):
    """MuJoCo's arrays of the vehicle."""

    qpos: Array  # (7,) position m and quaternion
    qvel: Array  # (6,) velocity m/s, world, and angular velocity rad/s, body
    xfrc: Array  # (6,) force N and torque Nm, world, applied by MuJoCo


@dataclass(frozen=True)
class Stage:
    """A user's own stage of the pipeline: a sensor, an actuator or a wind.

    ``run`` takes the ``ClosedLoop`` at each tick and changes the loop's arrays in place. A pose
    2 cm off for the filter, and a rotor without a tenth of its speed from 5 s on:

    ```python
    def offset(loop):
        loop.sample[4] += 0.02

    def weaken(loop):
        if loop.time > 5.0:
            loop.command[0] *= 0.9

    stages = [Stage("offset", offset, before="estimate"), Stage("weaken", weaken, before="actuate")]
    env = gym.make("windwrench/FanTracking-v1", stages=stages)
    ```

    A force of one's own is added to ``loop.applied`` (6,) before ``actuate``.

    Raises:
        InputError: ``run`` is no function, or no stage of the kit has the name ``before``.
    """

    name: str
    run: Callable[[ClosedLoop], object]
    before: str

    def __post_init__(self) -> None:
        if not callable(self.run):
            raise InputError(f"stage {self.name!r}: run must be a function of the loop")
        if self.before not in STAGES:
            raise unknown_name("stage", self.before, STAGES, f"stage {self.name!r}: before")


# the kit's own stages, in their order
STAGES: dict[str, Callable[[ClosedLoop], object]] = {
    "wind": lambda loop: loop.blow(),
    "sense": lambda loop: loop.run_stage(SENSE),
    "estimate": lambda loop: loop.run_stage(ESTIMATE),
    "steer": lambda loop: loop.run_stage(STEER),
    "actuate": lambda loop: loop.run_stage(ACTUATE, FEEL),
    "move": lambda loop: loop.move(),
}


class ClosedLoop:
    """One vehicle in closed loop with its estimate, ticked at 200 Hz.

    Args:
        declared: the vehicle as filter and flight loop know it.
        true: the vehicle with its undeclared effects; default: as declared.
        tuning: the filter's; default ``UKFTuning.for_vehicle(declared)``.
        fan: the jet, and the drag of the vehicle; None: still air without drag.
        settings: the plant's.
        gains: the flight loop's.
        drawn: whether the world has its parts for the eye alone.
        estimator: one of ``ESTIMATORS``.
        accelerometer: standard deviation in m/s2 of its noise, a tick, and of its bias. None: there
            is no accelerometer, and a tick uses ``NOISE`` unit normals instead of three more.
        model_in_loop: whether the flight loop counters the effects of ``declared``.
        kind: commands in ``action``, once the filter has settled.
        stages: a user's own, in the pipeline of a tick.
        like: a loop whose MuJoCo model is this one's, too, if the rigid bodies are the same.
        rotors: (4, 3) m, where winds meet the rotors; default: the true vehicle's.

    Attributes:
        state: (20,) estimated state, laid out as in ``estimator.estimate``.
        covariance: (18, 18) of the estimate.
        setpoint: (11,) position, velocity, acceleration, yaw and yaw rate to fly to.
        action: (4,) the command, of the kind ``kind``: in m/s2, world, beside the flight loop's own
            acceleration, or as ``controllers.flight`` says.
        command: (4,) rad/s, of the rotors.
        sample: (11,) rotor speeds, position and quaternion of the last measurement.
        unrounded: (4,) rad/s, these rotor speeds before rounding.
        air: (STATIONS, 3) m/s, world, of the winds at the stations.
        position: (3,) m, world, true, of the geometric centre; ``quaternion`` (4,), body to world,
            and ``velocity`` (3,) m/s, world, likewise.
        motion: MuJoCo's generalised position and velocity, the vehicle's first (7,) and (6,).
        external: (6,) true external force N and torque Nm, world. Its parts are ``jet``, the
            actuators' ``disturbance``, and a user's ``applied``.
        specific: (3,) m/s2, world, specific force by the accelerometer, mean of the last run.
        thrust: (3,) m/s2, likewise that of the rotors by the declared model.

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
        drawn: bool = False,
        estimator: str = "ukf",
        accelerometer: tuple[float, float] | None = None,
        model_in_loop: bool = False,
        kind: int = BESIDE,
        stages: Sequence[Stage] = (),
        like: ClosedLoop | None = None,
        rotors: Array | None = None,
    ) -> None:
        if estimator not in ESTIMATORS:
            raise unknown_name("estimator", estimator, ESTIMATORS)
        self.true = declared if true is None else true
        plant, self._body = plant_record(self.true, settings or PlantSettings())
        self.model, self.data = self._make_world(drawn, like)
        self.own_stages = tuple(stages)
        self.record = np.zeros(1, dtype=LOOP)
        loop = self.record[0]
        loop["plant"] = plant[0]
        # the flight loop's model has no effects but those of the body: mass, inertia and its centre
        loop["flight"] = flight_record(compile_effects(declared).vehicle, gains)[0]
        loop["model_in_loop"], self.kind = model_in_loop, kind
        self.jet_table = _NO_JET
        if fan is not None:
            places = self._body.positions if rotors is None else rotors
            loop["fan"] = fan_record(fan, places, TICK)[0]
            loop["fan"]["blown"] = 1  # drag, in still air too
            self.jet_table = _jet(fan.radius, fan.hub_radius)
        self.accelerometer = accelerometer
        self.noise_size = NOISE
        if accelerometer is not None:
            self.noise_size += ACCELEROMETER_NOISE
            loop["accelerometer_sigma"] = accelerometer[0]
        self.ukf = ESTIMATORS[estimator](declared, tuning, TICK)
        self.winds, self.reference = Sum(), np.zeros((0, REFERENCE_SIZE))
        self.noise, self.row = np.zeros((1, self.noise_size)), 0  # normals of the run, and its tick
        self.fan_path = self._fan_at_rest = np.array([[0.0, float(loop["fan"]["height"])]])
        self._settled = 0  # ticks before the episode
        self._carried = tuple(self.__dict__)  # to a copy, where ``_bind`` adds the rest
        self._bind()

    def _make_world(
        self, drawn: bool, like: ClosedLoop | None
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        if like is not None and is_same_body(like._body, self._body):
            return like.model, mujoco.MjData(like.model)
        return load_world(self._body, drawn)

    def _bind(self) -> None:
        """Lay Python's arrays over the record and MuJoCo's data, and find the core's functions."""
        loop, ukf = self.record[0], self.ukf.record[0]
        self.address: int = self.record.ctypes.data
        loop["filter"], loop["step"] = self.ukf.record.ctypes.data, self.ukf.step_address
        loop["jet"], loop["mujoco_step"] = self.jet_table.ctypes.data, _MUJOCO_STEP
        loop["model"], loop["data"] = self.model._address, self.data._address
        lay_addresses(loop["plant"], compile_effects(self.true))
        self.state: Array = ukf["x"]
        self.covariance: Array = ukf["P"]
        self.setpoint: Array = loop["flight"]["setpoint"]
        self.command: Array = loop["flight"]["command"]
        self.action: Array = loop["action"]
        self.sample: Array = loop["plant"]["z"]
        self.unrounded: Array = loop["plant"]["sample"][:4]
        self.air: Array = loop["fan"]["air"]
        self.external: Array = loop["plant"]["external"]
        self.jet: Array = loop["plant"]["jet"]
        self.disturbance: Array = loop["plant"]["disturbance"]
        self.applied: Array = loop["plant"]["applied"]
        self.specific: Array = loop["specific"]
        self.thrust: Array = loop["thrust"]
        self.points: Array = loop["points"]
        self._ticks: np.ndarray = self.record["ticks"]
        self.stages = self._pipeline(self.own_stages)
        self._look_at_world()

    @staticmethod
    def _pipeline(user_stages: Sequence[Stage]) -> dict[str, Callable[[ClosedLoop], object]]:
        """Return the stages of a tick by their names, in running order."""
        stages = {}
        for name, run in STAGES.items():
            for stage in user_stages:
                if stage.before == name:
                    if stage.name in STAGES or stage.name in stages:
                        raise InputError(f"stage {stage.name!r}: there is one of this name")
                    stages[stage.name] = stage.run
            stages[name] = run
        return stages

    def _look_at_world(self) -> None:
        """Take the arrays of MuJoCo's data; a reset may have moved them."""
        p, v = self.motion = self.data.qpos, self.data.qvel
        self.position, self.quaternion, self.velocity = p[:3], p[3:7], v[:3]
        xfrc: Array = self.data.xfrc_applied[self.model.body("vehicle").id]
        self.world = World(p[:7], v[:6], xfrc)
        loop = self.record[0]
        for name, array in zip(World._fields, self.world, strict=True):
            loop[name] = array.ctypes.data
        loop["reference"], loop["rows"] = self.reference.ctypes.data, len(self.reference)
        loop["winds"], loop["wind_count"] = self.winds.calls.ctypes.data, len(self.winds.calls)
        loop["blowing"] = len(self.winds.winds)

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
        """Time since the start of the episode, s."""
        return self.ticks * TICK

    @property
    def ticks(self) -> int:
        """Ticks since the start of the episode; below zero while the filter settles."""
        return int(self._ticks.item())

    def reset(
        self,
        rng: np.random.Generator,
        position: Array,
        yaw: float = 0.0,
        winds: Sequence[Wind] = (),
        reference: Array | None = None,
    ) -> None:
        """Hover at ``position`` (3,) m and ``yaw`` rad, with the filter started from one measured
        pose.

        Args:
            rng: generator of the start.
            position: the geometric centre's.
            yaw: rad.
            winds: at their time 0 until the episode begins.
            reference: (n, REFERENCE_SIZE), a row a tick; default: the set point moves with its own
                velocity alone.

        Raises:
            InputError: something is no wind, or has another shape.
        """
        blowing = Sum(*winds, where="ClosedLoop")
        samples = np.zeros((0, REFERENCE_SIZE)) if reference is None else reference
        rows = np.ascontiguousarray(samples, dtype=np.float64)
        if rows.shape[1:] != (REFERENCE_SIZE,) or not np.all(np.isfinite(rows)):
            raise InputError(
                f"ClosedLoop: reference must be finite numbers, shape (n, {REFERENCE_SIZE}), "
                f"got shape {rows.shape}"
            )
        mujoco.mj_resetData(self.model, self.data)
        self.winds, self.reference = blowing, rows
        self._look_at_world()
        loop = self.record[0]
        self.action[:], loop["kind"] = 0.0, self.kind
        if self.accelerometer is not None:
            loop["accelerometer_bias"] = self.accelerometer[1] * rng.standard_normal(3)
        loop["ticks"] = self._settled = 0
        reset_plant(loop["plant"], self._body)
        self.position[:], self.quaternion[:] = position, quaternion_of_yaw(yaw)
        loop["plant"]["past_poses"] = self.world.qpos
        self.setpoint[:] = 0.0
        self.setpoint[:3], self.setpoint[9] = position, yaw
        reset_flight(loop["flight"])
        self.air[:] = 0.0
        loop["fan"]["gusts"] = loop["fan"]["mixing"] @ rng.standard_normal((STATIONS, 3))
        _core.run_stage(self.address, SENSE, self._fan_at_rest, rng.standard_normal((1, NOISE)), 0)
        self.ukf.reset(self.sample[4:7], self.sample[7:11])
        mujoco.mj_forward(self.model, self.data)

    def settle(self, rng: np.random.Generator, ticks: int, fan_path: Array | None = None) -> None:
        """Let the filter settle for ``ticks`` of flight before the episode begins.

        Args:
            rng: generator of the noise.
            ticks: even: the winds blow from the first.
            fan_path: the fan's place meanwhile, as in ``run``.
        """
        loop = self.record[0]
        loop["ticks"], self._settled, loop["kind"] = -ticks, ticks, BESIDE
        self.run(rng.standard_normal((ticks, self.noise_size)), fan_path)
        loop["kind"] = self.kind

    def run(self, noise: Array, fan_path: Array | None = None) -> None:
        """Run one tick for each row of ``noise``.

        Args:
            noise: (n, ``noise_size``) unit normals.
            fan_path: (m,) the fan's y in m, or (m, 2) its y and height, tick by tick of this run.
                After the last row the fan stands still. Default: y = 0.

        Raises:
            InputError: a shape is wrong, or an effect of a user's own raised an error.
        """
        noise = np.ascontiguousarray(noise, dtype=np.float64)
        path = self._fan_at_rest if fan_path is None else np.ascontiguousarray(fan_path, np.float64)
        if path.ndim == 1:
            path = np.column_stack([path, np.full(len(path), self._fan_at_rest[0, 1])])
        count, last = len(noise), len(path) - 1
        if noise.shape != (count, self.noise_size) or path.shape != (last + 1, 2) or last < 0:
            raise InputError(
                f"ClosedLoop: expected noise (n, {self.noise_size}) and fan_path (m,) or (m, 2); "
                f"got shapes {noise.shape} and {path.shape}"
            )
        with Untimed():
            in_python = self.own_stages or self.winds.own or any(ask() for ask in _CALLBACKS)
            if not in_python:
                _core.run_ticks(self.address, path, noise)
                raise_errors()
                return
            self.noise, self.fan_path = noise, path
            for k in range(count):
                self.row = k
                for stage in self.stages.values():
                    stage(self)
                raise_errors()

    def run_stage(self, *numbers: int) -> None:
        """Run stages of the core in the present tick."""
        for number in numbers:
            _core.run_stage(self.address, number, self.fan_path, self.noise, self.row)

    def blow(self) -> None:
        """Write the winds at the vehicle's stations into ``air``, every second tick."""
        self.run_stage(WIND)
        if self.ticks % WIND_EVERY == 0:
            for wind in self.winds.own:
                self.air += wind.velocity(self.points.T, max(self.ticks, 0) * TICK)

    def move(self) -> None:
        """Let MuJoCo integrate the rigid body over the tick."""
        mujoco.mj_step(self.model, self.data, SUBSTEPS)
        self._ticks += 1

    @property
    def was_reset(self) -> bool:
        """Whether MuJoCo reset the vehicle on its own, silently, for a state that is not finite.
        Its time then is zero.
        """
        return bool(self.data.time < (self._settled + self.ticks - 0.5) * TICK)

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy's start: no views, and no addresses of this process."""
        record = self.record.copy()
        for name in _ADDRESSES:
            record[name] = 0
        record["plant"] = without_addresses(record["plant"])
        carried = {name: getattr(self, name) for name in (*self._carried, "_carried")}
        return carried | {"record": record}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def healthy(self) -> bool:
        """Whether the vehicle still flies: every number of plant and filter finite, and nothing
        faster than a vehicle.
        """
        return _core.is_healthy(self.address) and not self.was_reset
