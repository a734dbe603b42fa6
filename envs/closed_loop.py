"""Plant, wrench filter and flight loop together: a vehicle that flies to a set point and feels the wind."""

import math
from collections.abc import Callable
from contextlib import nullcontext

import mujoco
import numpy as np

from ..controllers.flight import FLIGHT, FlightGains, flight_record, fly, move_setpoint
from ..dynamics.compiled import Record, announced, compiled, compiled_meanwhile, is_compiled
from ..dynamics.effects import compile_effects
from ..dynamics.errors import InputError, unknown_name
from ..dynamics.motion import Array
from ..dynamics.rotation import quaternion_of_yaw
from ..dynamics.vehicle import Vehicle
from ..estimator.by_address import call_step
from ..estimator.constant_gain import ConstantGainFilter
from ..estimator.direct import direct, released
from ..estimator.filter_record import FILTER
from ..estimator.tuning import UKFTuning
from ..estimator.ukf import WrenchUKF, correct_parts
from .jet import FAN, Fan, fan_record, jet_table
from .plant import NOISE, PLANT, SUBSTEPS, TICK, PlantSettings, actuate, load_world, plant_record, reset_plant, sense
from .stepping import mj_step, mj_step_address
from .suspended_load import SuspendedLoad, hang, pull, set_down

FASTEST = 200.0  # m/s and rad/s; a vehicle is not
_AT_REST = np.zeros(1)
LOOP = np.dtype([("plant", PLANT), ("filter", FILTER), ("step", "i8"), ("flight", FLIGHT), ("fan", FAN)])

# what estimates the wrench in flight
ESTIMATORS: dict[str, type[WrenchUKF]] = {"ukf": WrenchUKF, "constant-gain": ConstantGainFilter}


@compiled
def tick(loop: Record, axial: Array, radial: Array, qpos: Array, qvel: Array, xfrc: Array, noise: Array) -> None:
    """Sense, estimate, steer and actuate once; MuJoCo's ``xfrc`` (6,) then holds the wrench of this tick.

    ``noise`` (NOISE,) are unit normals. Everything that changes lies in ``loop`` and the arrays given.
    """
    plant, ukf, flight = loop.plant, loop.filter, loop.flight
    plant.seen = sense(plant, qpos, noise)
    for i in range(len(ukf.z)):
        ukf.z[i] = plant.z[i]
    call_step(loop.step, ukf, plant.seen, TICK, plant.battery)
    move_setpoint(flight, ukf.x, TICK)
    fly(flight, ukf.x, TICK)
    actuate(plant, flight.command, loop.fan, axial, radial, qpos, qvel, noise, xfrc)


@released
def _run(loops: np.ndarray, axial: Array, radial: Array, qpos: Array, qvel: Array, xfrc: Array, noise: Array,
         fan_y: Array, first: int, step: int, model: int, data: int) -> None:
    """Run one tick for each row of ``noise``; the last three are the addresses of ``mj_step`` and of its arguments."""
    loop = loops[0]
    for k in range(len(noise)):
        loop.fan.y = fan_y[min(first + k, len(fan_y) - 1)]
        tick(loop, axial, radial, qpos, qvel, xfrc, noise[k])
        for _ in range(SUBSTEPS):
            mj_step(step, model, data)


def compile_run() -> None:
    """Compile the correction, which the filter's step compiles last, and the loop: half of what a first flight needs."""
    vector, table = np.zeros(1), np.zeros((2, 2))
    direct(correct_parts, np.zeros(1, dtype=FILTER)[0], vector, 3)
    direct(_run, np.zeros(1, dtype=LOOP), table, table, vector, vector, vector, table, vector, 0, 0, 0, 0)


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
        plant, self._body = plant_record(declared if true is None else true, settings or PlantSettings())
        self.model, self.data = load_world(self._body, load, drawn)
        self.jet_table = jet_table(fan.radius, fan.hub_radius) if fan else (np.zeros((2, 2)), np.zeros((2, 2)))
        self.record = np.zeros(1, dtype=LOOP)
        loop = self.record[0]
        loop["plant"] = plant[0]
        # the flight loop's model has no effects but those of the body: mass, inertia and its centre
        loop["flight"] = flight_record(compile_effects(declared).vehicle, gains)[0]
        if fan is not None:
            loop["fan"] = fan_record(fan, self._body.positions, TICK)[0]
        self._load = load
        self._body_id = self.model.body("vehicle").id
        self._steps = 0
        self._call: Callable[..., None] | None = None
        with nullcontext() if is_compiled(_run) else announced():
            with compiled_meanwhile(_run, compile_run):
                self.ukf = ESTIMATORS[estimator](declared, tuning, TICK)
                loop["step"] = self.ukf.step_address
            loop["filter"] = self.ukf.record[0]
            self._views()
            self.run(np.empty((0, NOISE)))  # compiles it

    def _views(self) -> None:
        self._qpos: Array = self.data.qpos
        self._qvel: Array = self.data.qvel
        self._xfrc: Array = self.data.xfrc_applied[self._body_id]
        loop = self.record[0]
        self.state: Array = loop["filter"]["x"]  # (20,) estimated state, laid out as in estimator.estimate
        self.covariance: Array = loop["filter"]["P"]
        self.setpoint: Array = loop["flight"]["setpoint"]
        self.external: Array = loop["plant"]["external"]  # (6,) true external wrench, world
        self.jet: Array = loop["plant"]["jet"]  # (6,) parts of it: of the jet,
        self.disturbance: Array = loop["plant"]["disturbance"]  # (6,) of the actuators' unmodelled disturbance,
        self.applied: Array = loop["plant"]["applied"]  # (6,) and that a user applies; zero after a reset
        self.sample: Array = loop["plant"]["z"]  # (11,) turn rates, position, quaternion
        self._world = (self.record, *self.jet_table, self._qpos, self._qvel, self._xfrc)
        self._addresses = (mj_step_address(), self.model._address, self.data._address)

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
        return self._steps * TICK

    def reset(self, rng: np.random.Generator, position: Array, yaw: float = 0.0) -> None:
        """Hover at ``position`` (3,) m and ``yaw`` rad, with the filter started from one measured pose."""
        mujoco.mj_resetData(self.model, self.data)
        self._views()
        self._steps = 0
        loop = self.record[0]
        reset_plant(loop["plant"], self._body)
        self._qpos[:3], self._qpos[3:7] = position, quaternion_of_yaw(yaw)
        self.setpoint[:] = 0.0
        self.setpoint[:3], self.setpoint[9] = position, yaw
        loop["flight"]["sum"], loop["flight"]["yaw_sum"] = 0.0, 0.0
        loop["fan"]["gusts"] = loop["fan"]["mixing"] @ rng.standard_normal((len(loop["fan"]["gusts"]), 3))
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
            raise InputError("ClosedLoop: there is no load to hang on; give one with load=SuspendedLoad(...)")
        hang(self.model, self.data, self._load)

    def load_pull(self) -> Array:
        """Return the true force (N) and torque (Nm) about the centre of mass, (6,) world, of a load on the vehicle."""
        return pull(self.data, self._body.com)

    def run(self, noise: Array, fan_y: Array | None = None, first: int = 0) -> None:
        """Run one tick for each row of ``noise`` (n, NOISE), all of them in one compiled call that lets other threads run.

        Args:
            noise: unit normals.
            fan_y: (m,) m, where the fan is tick by tick; after the last it stands still. Default: at 0.
            first: the first tick's place in ``fan_y``.

        Raises:
            InputError: a shape is wrong.
        """
        noise = np.ascontiguousarray(noise, dtype=np.float64)
        fan_y = _AT_REST if fan_y is None else np.ascontiguousarray(fan_y, dtype=np.float64)
        if noise.ndim != 2 or noise.shape[1] != NOISE or fan_y.ndim != 1 or len(fan_y) == 0 or first < 0:
            raise InputError(f"ClosedLoop: expected noise (n, {NOISE}), fan_y (m,) and first from 0 on; got shapes "
                             f"{noise.shape}, {fan_y.shape} and first = {first}")
        if self._call is None:
            self._call = direct(_run, *self._world, noise, fan_y, first, *self._addresses)
        self._call(*self._world, noise, fan_y, first, *self._addresses)
        self._steps += len(noise)

    @property
    def was_reset(self) -> bool:
        """Whether MuJoCo reset the vehicle on its own: it does so, silently in code, where a state is not finite."""
        return bool(self.data.time < self.time - 0.5 * TICK)

    def healthy(self) -> bool:
        """Whether it still flies: every number of plant and filter finite, and nothing faster than a vehicle can be."""
        return (math.isfinite(sum(self.state.tolist()[:19])) and all(abs(v) < FASTEST for v in self._qvel.tolist())
                and not self.was_reset)
