"""``python -m evidence.perfect_models``: how often a diagnosis believes a perfect model.

Three plants fly exactly as declared, in gusts of up to 5 % of the weight: the kit's, a simulator
written apart, and the one below. A claim is a name, or a cause outside the library with a
probability of at least .25.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from scipy.spatial.transform import Rotation

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.plant import TICK
from windwrench.envs.recording import draw_trajectory
from windwrench.envs.wind.turbulence import spectrum
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.probabilities.flights import simulator_at, vehicle_of
from windwrench.evidence.runner import Jobs, Task, code_stamp, run_tasks, start
from windwrench.evidence.scoring import share
from windwrench.evidence.trials.logged_poses import POSITION_HZ, without_pose
from windwrench.evidence.trials.practice_flights import fly_practice
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.table import Array
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

RESULTS = "results/perfect_models.json"
PLANTS = ("own", "other", "third")
VEHICLES = {"own": "ardrone2", "third": "hummingbird"}
# what a loop sees: the share of the log's noise in its pose, and of the rotors' acceleration in its
# observer. The kit's loop has a filter in each case, the other simulator's the true state
LOOPS = {"pose": (1.0, 0.0), "filter": (1.0, 1.0), "gyro": (0.05, 1.0)}
GUSTS = ("none", "Ornstein-Uhlenbeck", "dryden", "von-karman")
TRAJECTORIES = ("excite", "gentle", "fast", "hover")  # of both simulators
LOGS = ("pose", "pose and IMU", f"IMU and {POSITION_HZ:g} positions a second", "IMU alone")
LEAST_UNKNOWN = 0.25  # a claim
SIZES = (0.002, 0.05)  # of the weight: RMS of a gust
TIMES = (0.15, 1.5)  # s, correlation times of a gust
ARM = 0.25  # of the arm, at which a gust of force acts as a torque
STEPS = 5  # of a tick, for the plant below
MOTOR_LAG = 0.03  # s


def gusts(kind: str, vehicle: Vehicle, rng: np.random.Generator, count: int) -> Array:
    """Return forces and torques (count, 6), N and Nm, of one of ``GUSTS`` at every tick."""
    size, time = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (SIZES, TIMES))
    if kind == "none":
        return np.zeros((count, 6))
    form = kind if kind in GUSTS[2:] else "dryden"
    axes = ["along", "across", "across"] if form == kind else ["along"] * 3
    # at an airspeed of 1 m/s
    turns = 2.0 * np.pi * np.fft.rfftfreq(count, TICK)
    power = np.column_stack([spectrum(form, axis, turns, 1.0, time) for axis in 2 * axes])
    white = np.fft.rfft(rng.standard_normal((count, 6)), axis=0)
    x = np.fft.irfft(white * np.sqrt(power), count, axis=0)
    unit = size * vehicle.weight * np.repeat([1.0, ARM * vehicle.arm_l], 3)
    return np.asarray(unit * x / x.std(axis=0))


def fly_third(
    vehicle: Vehicle, loop: str, path: Array, wrench: Array, rng: np.random.Generator
) -> list[Array]:
    """Fly a rigid body by leapfrog steps of 1 ms, with rotors of a first-order lag.

    Args:
        vehicle: as declared.
        loop: one of ``LOOPS``.
        path: (n, 11) set points.
        wrench: (n, 6) N, world, and Nm, body.
        rng: of the pose's noise.

    Returns:
        Positions (n, 3) and attitudes (n, 4) with noise, rotor speeds (n, 4), true specific force
        and angular velocity (n, 3), body axes.
    """
    seen, model = LOOPS[loop]
    h, mass, inertia = TICK / STEPS, vehicle.mass, np.diagonal(vehicle.inertia)
    down = np.array([0.0, 0.0, vehicle.gravity])
    # thrust and torques by squared rotor speeds, counterclockwise from the front left
    signs = np.array([[1, 1, 1, 1], [1, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1]])
    k, arm = float(vehicle.k[0]), vehicle.arm_l
    mix = np.array([k, arm * k, arm * k, float(vehicle.p[0])])[:, None] * signs
    hover = vehicle.weight / (4.0 * k)
    keep = np.exp(-h / MOTOR_LAG)
    position, velocity, rate = path[0, :3].copy(), np.zeros(3), np.zeros(3)
    rotation = Rotation.from_euler("z", path[0, 9]).as_matrix()
    speeds = np.full(4, np.sqrt(hover))
    # the loop's observer, as fast as the noise of its pose allows
    place, speed, attitude, turning = position, velocity, rotation, rate
    slow, fast = np.array([4.0, 10.0]) * 2.0 * np.pi * (3.0 if seen < 1.0 else 1.0)
    std = np.repeat([vehicle.mocap.sigma_pos_m, vehicle.mocap.sigma_att_rad], 3)
    noise = std * rng.standard_normal((len(path), 6))
    out = np.empty((len(path), 17))
    for n, (goal, push) in enumerate(zip(path, wrench, strict=True)):
        wrung = mix @ speeds**2
        felt = (push[:3] @ rotation + [0.0, 0.0, wrung[0]]) / mass
        logged = Rotation.from_matrix(rotation @ _turn(noise[n, 3:])).as_quat(scalar_first=True)
        out[n] = np.concatenate([position + noise[n, :3], logged, speeds, felt, rate])
        off = TICK * (position + seen * noise[n, :3] - place)
        tilt = TICK * _angles(attitude.T @ rotation @ _turn(seen * noise[n, 3:]))
        place = place + TICK * speed + 1.4 * slow * off
        by_rotors = attitude[:, 2] * wrung[0] / mass - down
        speed = speed + slow**2 * off + TICK * model * by_rotors
        attitude = attitude @ _turn(TICK * turning + 1.4 * fast * tilt)
        turning = turning + fast**2 * tilt + TICK * model * wrung[1:] / inertia
        wanted = goal[6:9] + down + 5.0 * (goal[:3] - place) + 3.5 * (goal[3:6] - speed)
        up = wanted / np.linalg.norm(wanted)
        left = np.cross(up, [np.cos(goal[9]), np.sin(goal[9]), 0.0])
        left /= np.linalg.norm(left)
        aim = attitude.T @ np.column_stack([np.cross(left, up), left, up])
        torque = inertia * (60.0 * _angles(aim) - 12.0 * turning) * [1.0, 1.0, 0.4]
        asked = np.linalg.solve(mix, np.append(mass * wanted @ attitude[:, 2], torque))
        command = np.sqrt(np.clip(asked, 0.1 * hover, 3.0 * hover))
        for _ in range(STEPS):
            position, rotation = position + 0.5 * h * velocity, rotation @ _turn(0.5 * h * rate)
            speeds = command + keep * (speeds - command)
            wrung = mix @ speeds**2
            velocity = velocity + h * ((rotation[:, 2] * wrung[0] + push[:3]) / mass - down)
            rate = rate + h * (wrung[1:] + push[3:] - np.cross(rate, inertia * rate)) / inertia
            position, rotation = position + 0.5 * h * velocity, rotation @ _turn(0.5 * h * rate)
    return np.split(out, [3, 7, 11, 14], axis=1)


def _turn(angles: Array) -> Array:
    """Return the rotation (3, 3) by small angles (3,) rad, to the third order."""
    x, y, z = angles
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    square = cross @ cross
    return np.asarray(np.eye(3) + cross + 0.5 * square + cross @ square / 6.0)


def _angles(rotation: Array) -> Array:
    """Return the small angles (3,) rad of a rotation (3, 3)."""
    x = rotation - rotation.T
    return 0.5 * np.array([x[2, 1], x[0, 2], x[1, 0]])


def flown(plant: str, number: int, seconds: float, simulator: str) -> tuple[FlightLog, Vehicle]:
    """Return a flight's log, with pose, and true gyro and accelerometer, and its vehicle.

    Args:
        plant: one of ``PLANTS``.
        number: of the flight; loop, gusts and trajectory go with it in turn.
        seconds: length of the log.
        simulator: file of the other simulator.

    Raises:
        InputError: no such simulator.
    """
    rng = np.random.default_rng((number, PLANTS.index(plant)))
    count = round(seconds / TICK) + 1
    loop = list(LOOPS)[number % len(LOOPS)]
    trajectory = TRAJECTORIES[number // 4 % len(TRAJECTORIES)]
    name = f"{plant} {number}: {trajectory}"
    t = np.linspace(0.0, TICK * (count - 1), count)
    other = simulator_at(Path(simulator)) if plant == "other" else None
    vehicle = vehicle_of(other) if other else load_vehicle(VEHICLES[plant])
    wrench = gusts(GUSTS[number % len(GUSTS)], vehicle, rng, count)
    if plant == "own":
        log = fly_practice(
            vehicle,
            (),
            trajectory,
            seconds,
            number,
            turbulence=0.0,
            imu=True,
            seen=LOOPS[loop][0],
            push=lambda at: wrench[min(round(at.time / TICK), count - 1)],
        )
        return replace(log, name=name), vehicle
    if other:
        _, path, dither = other.trajectory(trajectory, rng, seconds)
        force, torque = np.split(wrench[: len(path)], 2, axis=1)
        x, *_ = other.fly(
            path,
            dither,
            force,
            torque,
            np.full(len(path), 12.0),
            other.PV,
            other.effvec(),
            other.GAINS,
        )
        true = Rotation.from_quat(x[:, 6:10], scalar_first=True)
        noise = rng.standard_normal((2, len(x), 3))
        position = x[:, :3] + vehicle.mocap.sigma_pos_m * noise[0]
        turned = true * Rotation.from_rotvec(vehicle.mocap.sigma_att_rad * noise[1])
        speeds, gyro = x[:, 13:17], x[:, 10:13]
        thrust = np.square(speeds) @ vehicle.k / vehicle.mass
        felt = true.inv().apply(force / vehicle.mass) + np.outer(thrust, [0.0, 0.0, 1.0])
        parts = [position, turned.as_quat(scalar_first=True), speeds, felt, gyro]
    else:
        path = draw_trajectory(trajectory, rng, t)
        parts = fly_third(vehicle, loop, path, wrench, rng)
    position, quaternion, speeds, felt, gyro = parts
    step = vehicle.omega_lsb or 0.1
    log = FlightLog(
        t[: len(speeds)],
        position,
        quaternion,
        step * np.round(speeds / step),
        accelerometer=felt,
        gyro=gyro,
        name=name,
    )
    return log, vehicle


def as_logged(log: FlightLog, kind: str, seed: int) -> FlightLog:
    """Return a flight as one of ``LOGS`` holds it; the IMU has noise and biases."""
    if kind == "pose":
        return replace(log, gyro=None, accelerometer=None)
    read = without_pose(log, seed, POSITION_HZ * (kind != "IMU alone"))
    if kind != "pose and IMU":
        return read
    return replace(read, position=log.position, quaternion=log.quaternion, valid=log.valid)


def claimed(
    plant: str, number: int, seconds: float, simulator: str, kinds: Sequence[str] = LOGS
) -> dict[str, Any]:
    """Return what is claimed of one flight, by kind of log; arguments as of ``flown``."""
    log, vehicle = flown(plant, number, seconds, simulator)
    out = {}
    for kind in kinds:
        found = diagnose([as_logged(log, kind, number)], vehicle)
        assert found.probabilities is not None
        names = {e.name: round(found.probabilities.names[e.name], 3) for e in found.effects}
        where = [f"{s.test}: {s.where}" for s in found.structure]
        out[kind] = {
            "names": names,
            "unknown": round(found.probabilities.unknown, 3),
            "where": where,
        }
    return out


def is_claim(told: Mapping[str, Any]) -> bool:
    """Return whether a diagnosis claims something to be missing."""
    return bool(told["names"]) or told["unknown"] >= LEAST_UNKNOWN


def table(done: Mapping[str, Mapping[str, Any]]) -> str:
    """Return counts of claims with Wilson's intervals, kinds of log by plants.

    Args:
        done: ``claimed`` by plant and number, such as "own 3".
    """
    lines = [["log", *PLANTS, "all"]]
    for kind in LOGS:
        each = {name: is_claim(told[kind]) for name, told in done.items()}
        own = [[x for name, x in each.items() if name.startswith(p)] for p in (*PLANTS, "")]
        lines.append([kind, *(share(sum(x), len(x)) for x in own)])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def study(
    flights: Annotated[int, typer.Option(min=1, help="Flights of each plant.")] = 100,
    seconds: Annotated[float, typer.Option(min=12.0, help="Length of a flight.")] = 24.0,
    simulator: Annotated[
        str, typer.Option(help="File of the other simulator.")
    ] = "../shared/generator/make_flights.py",
    jobs: Jobs = 1,
    out: Annotated[Path, typer.Option(help="Folder of what is done.")] = Path(
        "results/perfect_models"
    ),
) -> None:
    """Fly, diagnose, count claims and keep them."""
    code = commit()
    wanted: list[Task] = [(p, i, seconds, simulator) for i in range(flights) for p in PLANTS]
    stamp = code_stamp("perfect_models", "trials/practice_flights", "trials/logged_poses")
    done = run_tasks(claimed, wanted, out / "flights.jsonl", jobs, stamp)
    kept = {f"{plant} {number}": told for (plant, number, *_), told in done.items()}
    write_json({"commit": code, "seconds": seconds, "flights": kept}, DOCS / RESULTS)
    print(table(kept))


if __name__ == "__main__":
    start(study)
