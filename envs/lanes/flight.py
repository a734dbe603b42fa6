"""A tick of several closed loops side by side: the plant's, the flight loop's and the filter's own
functions, compiled for lanes (``runtime.vector_lanes``).

MuJoCo is not called here. Its semi-implicit Euler step of a free rigid body is ``fly_freely``, by
the equations of motion of the filter's prediction.
"""

from typing import Any, NamedTuple

import numpy as np

from ...controllers.flight import FLIGHT, FlightGains, move_setpoint, steer
from ...dynamics.motion import BODY, Array, accelerations, rotor_wrench
from ...dynamics.rotation import normalise, quaternion_to_matrix, turn_body
from ...estimator.ukf_lanes import (
    columns,
    in_hand,
    new_blocks,
    put_down,
    take_up,
    write_lanes,
)
from ...runtime.addresses import call_at
from ...runtime.compiled import Record, compiled, compiled_without_gil
from ...runtime.vector_lanes import WIDTH, LaneRecord
from ..closed_loop import ACCELEROMETER_NOISE, WIND_EVERY, ClosedLoop
from ..fan import FAN, STATIONS
from ..plant import (
    NOISE,
    PLANT,
    SUBSTEPS,
    TICK,
    add_up,
    blow,
    delay,
    disturb,
    follow,
    log_speeds,
    lose_pose,
    measure,
)
from ..state import Episodes, Motion
from ..wind.field import Calls, add_winds

LOOP = np.dtype(
    [
        ("plant", PLANT),
        ("flight", FLIGHT),
        ("fan", FAN),
        *[(name, "f8", (4,)) for name in ("action",)],
        *[(name, "f8", (3,)) for name in ("specific", "thrust", "accelerometer_bias")],
        ("accelerometer_sigma", "f8"),
        ("qpos", "f8", (7,)),
        *[(name, "f8", (6,)) for name in ("qvel", "xfrc", "acceleration", "none")],
        ("noise", "f8", (NOISE + ACCELEROMETER_NOISE,)),
    ]
)


def _between(form: np.dtype, first: str, last: str) -> tuple[str, ...]:
    """Return the names of a structured type's fields from ``first`` to ``last``."""
    names = form.names or ()
    return names[names.index(first) : names.index(last) + 1]


# the true body is each vehicle's own, the declared one everybody's
_BODY = LaneRecord(BODY, ("mass", "inertia", "inverse_inertia"), ("gravity", "com", "k", "mixing"))
_PLANT = LaneRecord(
    PLANT,
    ("rotor_wrench", *_between(PLANT, "omega_max", "past_felt")),
    ("effect_wrench", *_between(PLANT, "motor_keep", "applied")),
    {"body": _BODY},
)
_FLIGHT = LaneRecord(
    FLIGHT,
    ("setpoint", "sum", "yaw_sum", "rotation", "command"),
    ("body", "unmixing", "omega_max", "foreseen", *FlightGains.__dataclass_fields__),
)
_FAN = LaneRecord(
    FAN,
    ("speed", "rotor_drag", "hull_area", "gusts", "y", "height", "air"),
    ("turbulence", "keep", "mixing", "stations", "blown"),
)
# fields of a closed loop's own record: each lane's own, and common to all
_OWN = (
    *("qpos", "qvel", "xfrc", "acceleration", "noise"),
    *("action", "specific", "thrust", "accelerometer_bias"),
)
_COMMON = ("none", "accelerometer_sigma")
LOOPS = LaneRecord(LOOP, _OWN, _COMMON, {"plant": _PLANT, "flight": _FLIGHT, "fan": _FAN})
_loop_at = LOOPS.at


class BlockFields(NamedTuple):
    """Fields (blocks, ..., WIDTH) of the records for ``fly_blocks``, beside the motion."""

    noise: Array
    fan_y: Array
    fan_height: Array
    setpoint: Array
    action: Array
    stations: Array  # (blocks, STATIONS, 3)


@compiled
def blow_at(
    calls: Calls,
    time: Array,
    pose: Array,
    stations: Array,
    rotation: Array,
    points: Array,
    air: Array,
) -> None:
    """Write the winds at a vehicle's stations into ``air`` (3, STATIONS) m/s, for a pose (7,).

    The stations' places in the world go into ``points`` (3, STATIONS) m.
    """
    R, s = rotation, stations
    quaternion_to_matrix(pose[3:7], R)
    for i in range(STATIONS):
        for a in range(3):
            points[a, i] = pose[a] + R[a, 0] * s[i, 0] + R[a, 1] * s[i, 1] + R[a, 2] * s[i, 2]
    air[:] = 0.0
    add_winds(calls, time, points, air)


@compiled
def accelerate(loop: Record, xfrc: Array, noise: Array) -> None:
    """Add the specific force of an accelerometer in the centre of mass, in the world by the
    estimated attitude, and that of the rotors by the declared model.
    """
    plant, body = loop.plant, loop.flight.body
    R, E = plant.rotation, loop.flight.rotation
    thrust = 0.0
    for i in range(4):
        thrust += body.k[i] * plant.z[i] * plant.z[i]
    for j in range(3):
        felt = loop.accelerometer_bias[j] + loop.accelerometer_sigma * noise[NOISE + j]
        for i in range(3):
            felt += R[i, j] * xfrc[i] / plant.body.mass
        plant.scratch[j] = felt
    delay(plant.past_felt, plant.imu_late, plant.scratch, plant.late)
    for j in range(3):
        for i in range(3):
            loop.specific[i] += E[i, j] * plant.late[j]
        loop.thrust[j] += E[j, 2] * thrust / body.mass


@compiled
def fly_freely(loop: Record, dt: float) -> None:
    """Carry free rigid bodies ``dt`` s ahead as MuJoCo's integrator "Euler" does: velocities first,
    by explicit Euler, and with these new ones the pose.
    """
    qpos, qvel, q, R = loop.qpos, loop.qvel, loop.plant.q, loop.plant.rotation
    quaternion_to_matrix(qpos[3:7], R)
    accelerations(
        loop.plant.body,
        R,
        qvel[3:6],
        loop.none,
        loop.xfrc[3:6],
        loop.xfrc[0:3],
        loop.none,
        loop.acceleration,
    )
    for i in range(6):
        qvel[i] += dt * loop.acceleration[i]
    for i in range(3):
        qpos[i] += dt * qvel[i]
    turn_body(qpos[3:7], qvel[3], qvel[4], qvel[5], dt, q)
    normalise(q)
    for i in range(4):
        qpos[3 + i] = q[i]


@compiled
def tick_lanes(
    address: int, work: int, step: int, jet: Array, follows: bool, kind: int, feels: bool
) -> None:
    """Fly a tick of the loops with their record at ``address``: ``closed_loop.run_ticks`` without
    winds, and then the rigid body.

    The record at ``work`` holds their filters in hand; ``step`` is the address of their step.
    """
    loop, f = _loop_at(address), in_hand(work)
    plant, flight, fan, qpos, qvel = loop.plant, loop.flight, loop.fan, loop.qpos, loop.qvel
    delay(plant.past_poses, plant.pose_late, qpos, plant.late)
    measure(plant, plant.late, loop.noise)
    lose_pose(plant, loop.noise)
    for i in range(11):
        f.z[i] = plant.z[i]
    call_at(step, work)
    if not follows:
        move_setpoint(flight, f.x, TICK)
    steer(flight, f.x, loop.action, kind, TICK)
    follow(plant, flight.command)
    log_speeds(plant, plant.speeds)
    rotor_wrench(plant.body, plant.speeds, plant.rotor_wrench)
    quaternion_to_matrix(qpos[3:7], plant.rotation)
    blow(plant, fan, jet, qpos, qvel, loop.noise)
    disturb(plant, loop.noise)
    add_up(plant, loop.xfrc)
    if feels:
        accelerate(loop, loop.xfrc, loop.noise)
    for _ in range(SUBSTEPS):
        fly_freely(loop, TICK / SUBSTEPS)


@compiled_without_gil
def fly_blocks(
    begin: int,
    end: int,
    loops: tuple[int, int],
    kept: tuple[int, int],
    work: int,
    step: int,
    jet: Array,
    fields: BlockFields,
    motion: Motion,
    generators: Any,
    slots: np.ndarray,
    episodes: Episodes,
    calls: np.ndarray,
    winds: np.ndarray,
    ticks: int,
    noise_size: int,
    follows: bool,
    kind: int,
    moves: bool,
    places: np.ndarray,
) -> None:
    """Fly blocks ``begin`` to ``end - 1`` of loops side by side.

    Args:
        begin: a block.
        end: likewise.
        loops: address of the first block's record, of ``LOOPS``, and a record's bytes.
        kept: the same of the blocks' filters, of ``ukf_lanes``.
        work: address of this thread's own record for a block of filters in hand.
        step: address of the step of a block of filters.
        jet: (2, COUNT_X, COUNT_R) table of the jet.
        fields: parts of the records, written here.
        motion: the blocks' motion.
        generators: (n,) the environments' own, as a typed list.
        slots: (lanes,) the environment in each lane; -1: no flight and no draws.
        episodes: the environments' episodes; ticks are written.
        calls: (n, winds, 2) the environments' winds.
        winds: (n,) their number.
        ticks: number of ticks of ``TICK`` s.
        noise_size: unit normals of a tick.
        follows: whether the set point is a row of the reference, or moves by itself.
        kind: of the commands, as of ``controllers.flight.steer``.
        moves: whether commands are velocities of the set point.
        places: (commands,) indices of the commands in the set point, or in the loop's ``action``.
    """
    pose, rotation, time = np.empty(7), np.empty((3, 3)), np.empty(1)
    points, air = np.empty((3, STATIONS)), np.empty((3, STATIONS))
    first, feels = episodes.ticks, noise_size > NOISE
    for b in range(begin, end):
        members = slots[WIDTH * b : WIDTH * (b + 1)]
        if not np.any(members >= 0):
            continue
        loop, block = loops[0] + b * loops[1], kept[0] + b * kept[1]
        take_up(block, work)
        motion.specific[b], motion.thrust[b] = 0.0, 0.0
        for lane in range(WIDTH):
            n = members[lane]
            for i in range(episodes.commands.shape[1] if n >= 0 else 0):
                if moves:
                    fields.setpoint[b, places[i], lane] = episodes.commands[n, i]
                else:
                    fields.action[b, places[i], lane] = episodes.commands[n, i]
        for k in range(ticks):
            for lane in range(WIDTH):
                n = members[lane]
                if n < 0:
                    continue
                now = max(first[n] + k, 0)
                row = min(now, episodes.paths.shape[1] - 1)
                fields.fan_y[b, lane] = episodes.paths[n, row, 0]
                fields.fan_height[b, lane] = episodes.paths[n, row, 1]
                if follows:
                    row = min(now, episodes.references.shape[1] - 1)
                    for i in range(episodes.references.shape[2]):
                        fields.setpoint[b, i, lane] = episodes.references[n, row, i]
                if winds[n] > 0 and (first[n] + k) % WIND_EVERY == 0:
                    time[0] = now * TICK
                    pose[:] = motion.position[b, :, lane]
                    own = calls[n, : winds[n]]
                    blow_at(own, time, pose, fields.stations[b], rotation, points, air)
                    motion.air[b, :, :, lane] = air.T
                generator = generators[n]
                for i in range(noise_size):
                    fields.noise[b, i, lane] = generator.standard_normal()
            tick_lanes(loop, work, step, jet, follows, kind, feels)
        for n in members:
            if n >= 0:
                first[n] += ticks
        motion.specific[b] /= ticks
        motion.thrust[b] /= ticks
        put_down(block, work)


class LoopBlocks:
    """Memory of closed loops side by side, one to each lane of a block.

    All stand where ``like`` stands, and share the settings of ``like`` but for an episode's own.
    """

    def __init__(self, count: int, like: ClosedLoop) -> None:
        self.loops, self.filters = LOOPS.zeros(count), new_blocks(count)
        LOOPS.share(self.loops, _single(like))
        for block in range(count):
            self.put(block, slice(None), like)
        # addresses and bytes of the records of loops and filters, for ``fly_blocks``
        self.addresses = tuple(
            (int(records.ctypes.data), records.itemsize) for records in (self.loops, self.filters)
        )
        loops = self.loops
        fan, flight = loops["fan"], loops["flight"]
        self.motion = Motion(
            loops["qpos"],
            loops["qvel"],
            loops["plant"]["external"],
            self.filters["x"],
            self.filters["P"],
            loops["specific"],
            loops["thrust"],
            fan["air"],
        )
        self.fields = BlockFields(
            loops["noise"],
            fan["y"],
            fan["height"],
            flight["setpoint"],
            loops["action"],
            fan["stations"],
        )

    def __len__(self) -> int:
        """Return the number of blocks."""
        return len(self.loops)

    def put(self, block: int, lanes: slice, loop: ClosedLoop) -> None:
        """Let some lanes of a block stand where a closed loop stands."""
        LOOPS.write(self.loops, block, lanes, _single(loop))
        write_lanes(self.filters, block, lanes, loop.ukf.record)

    def take(self, block: int, lane: int, other: "LoopBlocks", source: int) -> None:
        """Let a lane of a block stand where the same lane of another's block stands."""
        for mine, theirs in (
            (LOOPS.columns(self.loops), LOOPS.columns(other.loops)),
            (columns(self.filters), columns(other.filters)),
        ):
            mine[block, :, lane] = theirs[source, :, lane]


def _single(loop: ClosedLoop) -> dict[str, Any]:
    """Return the contents of a closed loop's record and of MuJoCo, by the names of ``LOOPS``."""
    record = loop.record[0]
    single = {name: np.zeros(LOOP[name].shape) for name in (*_OWN, *_COMMON)}
    known = ("plant", "flight", "fan", "action", "specific", "thrust", "accelerometer_bias")
    single |= {name: record[name] for name in (*known, "accelerometer_sigma")}
    return single | {"qpos": loop.world.qpos, "qvel": loop.world.qvel}
