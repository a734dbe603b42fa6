"""The nearest public filter, ``drone-estimators``, on the flights of Fig. 5, in a process of its
own.

Its unscented filter has 19 states (position, quaternion, velocity, body rate, force, torque); the
quaternion is a plain vector of four to it: sigma points, mean and correction add and subtract it.
Set up here through its functional core, as ``KalmanFilter`` does it, with

* crazyflow's ``first_principles`` model with this vehicle's mass, inertia, rotors and mixing,
without drag and rotor inertia,
  commanded with the logged rotor speeds (in RPM), so that it predicts with the very same forces as
  ``WrenchUKF``;
* Q of the same four noises as ``UKFTuning``, mapped to velocity and position, body rate, torque and
force, at the start's
  attitude where a body axis matters (ours are equal in all axes, and the inertia is taken as it
  is);
* R of the same pose noise: a quaternion's component is as noisy as half the angle, in all four
directions;
* its own sigma points (alpha = 1, beta = 2, kappa = 0) and its own Euler integration;
* the sign of each measured quaternion chosen to be near the estimate: its innovation is a plain
difference.

crazyflow wants ``SCIPY_ARRAY_API`` to be set before scipy is loaded and brings jax: reason enough
for another process. ``python -m windwrench.paper.fig5_peer IN OUT`` is that process.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ..dynamics import Vehicle
from ..envs.plant import TICK
from ..estimator import NonlinearObserver, UKFTuning, WrenchEKF, WrenchUKF
from ..estimator.estimate import (
    FORCE,
    NIS,
    POSITION,
    QUATERNION,
    RATE,
    STATE_SIZE,
    TORQUE,
    VELOCITY,
)
from ..estimator.ukf import default_covariance
from .fig5_flights import Array, vehicle_at

_RPM = 30.0 / np.pi
_ROUNDS = 7
_TIMED_STEPS = 200
_TIME_LIMIT = 900.0  # s
# columns of its state
_P, _Q, _V, _W, _F, _T = (
    slice(0, 3),
    slice(3, 7),
    slice(7, 10),
    slice(10, 13),
    slice(13, 16),
    slice(16, 19),
)


def installed() -> bool:
    """Whether ``drone-estimators`` can be imported."""
    return all(find_spec(name) is not None for name in ("drone_estimators", "crazyflow", "jax"))


def run_peer(
    samples: dict[str, Array], timed: bool = True
) -> tuple[dict[str, Array], dict[str, float]]:
    """Run the peer over flights at each noise level, and time a step of every estimator.

    Args:
        samples: noise level -> (m, n, 11) samples of m flights.
        timed: whether to take times.

    Returns:
        Noise level -> states (m, n, 20) laid out as ours, empty without ``drone-estimators``; and
            the time of a step in us
        by estimator, the median of interleaved rounds (none if not ``timed``).

    Raises:
        RuntimeError: the process failed; the end of what it said is in the message.
    """
    names = {f"samples_{noise}": values for noise, values in samples.items()}
    words = ["timed"] if timed else []
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(source, **names)  # type: ignore[arg-type]
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        done = subprocess.run(
            [sys.executable, "-m", __name__, str(source), str(target), *words],
            capture_output=True,
            text=True,
            check=False,
            timeout=_TIME_LIMIT,
            env={**os.environ, **one, "SCIPY_ARRAY_API": "1", "JAX_PLATFORMS": "cpu"},
        )
        if done.returncode != 0:
            raise RuntimeError(done.stderr.strip()[-500:])
        with np.load(target) as out:
            states = {
                noise: out[f"states_{noise}"] for noise in samples if f"states_{noise}" in out
            }
            return states, {
                str(n): float(v) for n, v in zip(out["names"], out["times"], strict=True)
            }


def _model(vehicle: Vehicle) -> Callable[..., Any]:
    """Return crazyflow's dynamics with the parameters of a vehicle."""
    from crazyflow.dynamics.first_principles import dynamics

    x, y = np.sign(vehicle.positions[:, 0]), np.sign(vehicle.positions[:, 1])
    law = partial(
        dynamics,
        mass=vehicle.mass,
        L=np.array([vehicle.arm_l]),
        prop_inertia=np.zeros(1),
        gravity_vec=np.array([0.0, 0.0, -vehicle.gravity]),
        J=vehicle.inertia,
        J_inv=np.linalg.inv(vehicle.inertia),
        rpm2thrust=np.stack([0 * vehicle.k, 0 * vehicle.k, vehicle.k / _RPM**2], axis=1),
        rpm2torque=np.stack([0 * vehicle.p, 0 * vehicle.p, vehicle.p / _RPM**2], axis=1),
        mixing_matrix=np.stack([y, -x, -vehicle.spin]),
        drag_matrix=np.zeros((3, 3)),
        rotor_dyn_coef=np.zeros((1, 4)),
    )

    def move(pos: Any, cmd: Any, rotor_vel: None, **others: Any) -> tuple[Any, ...]:
        # the rotors turn as commanded, at every sigma point: crazyflow 0.4.0 stumbles over one
        # command for all of them
        cmd = cmd + 0.0 * pos[..., :1]
        return *law(pos=pos, cmd=cmd, rotor_vel=cmd, **others)[:4], None

    return move


def _settings(vehicle: Vehicle, tuning: UKFTuning) -> Any:
    """Return the peer's settings with the noises of ``tuning``."""
    from drone_estimators.structs.ukf_data import SigmaPointsSettings, UKFSettings
    from drone_estimators.utils.dynamics import observation_function

    def variance(deviation: Any) -> Array:
        return np.diag(np.broadcast_to(np.square(np.asarray(deviation, dtype=np.float64)), 3))

    B = np.linalg.inv(vehicle.inertia) * TICK
    push = variance(tuning.thrust_noise) * (TICK / vehicle.mass) ** 2
    noise = np.zeros((19, 19))
    noise[_W, _W] = B @ variance(tuning.motor_torque_noise) @ B.T
    noise[_V, _V], noise[_P, _P] = push, 0.25 * TICK**2 * push
    noise[_P, _V] = noise[_V, _P] = 0.5 * TICK * push
    noise[_F, _F], noise[_T, _T] = variance(tuning.force_walk), variance(tuning.torque_walk)
    measured = np.zeros((7, 7))
    measured[:3, :3] = variance(tuning.position_noise)
    measured[3:, 3:] = np.eye(4) * (float(np.mean(np.asarray(tuning.attitude_noise))) / 2.0) ** 2
    points = SigmaPointsSettings.create(n=19, alpha=1.0, beta=2.0, kappa=0.0)
    return UKFSettings.create(
        SPsettings=points, Q=noise, R=measured, fx=_model(vehicle), hx=observation_function
    )


def _start(vehicle: Vehicle, tuning: UKFTuning, samples: Array) -> Any:
    """Return the peer's data at the first of samples (m, n, 11), with the start's covariance as
    ours has it.
    """
    from drone_estimators.structs.estimator_data import EstimatorData

    data = EstimatorData.create_empty(dist_f=True, dist_t=True, batch_shape=samples.shape[:-2])
    ours = np.diag(default_covariance(vehicle, tuning))
    diagonal = np.empty(19)
    diagonal[_P], diagonal[_V], diagonal[_W] = ours[6:9], ours[9:12], ours[3:6]
    diagonal[_Q] = 4.0 * ours[0]  # a component of the quaternion is twice an MRP
    diagonal[_F], diagonal[_T] = ours[15:18], ours[12:15]
    covariance = np.broadcast_to(np.diag(diagonal), data.covariance.shape)
    return data.replace(
        pos=samples[..., 0, 4:7],
        quat=np.roll(samples[..., 0, 7:11], -1, axis=-1),
        covariance=covariance,
        dt=np.full(samples.shape[:-2], TICK),
    )


def _measured(data: Any, sample: Array) -> Any:
    """Return ``data`` with the rotor speeds and the pose of a sample (..., 11)."""
    q = np.roll(sample[..., 7:11], -1, axis=-1)
    near = np.sum(q * np.asarray(data.quat), axis=-1, keepdims=True)
    return data.replace(
        u=sample[..., :4] * _RPM,
        z=np.concatenate([sample[..., 4:7], np.where(near < 0, -q, q)], axis=-1),
    )


def _run(vehicle: Vehicle, tuning: UKFTuning, samples: Array) -> Array:
    """Return the peer's states (m, n, 20), laid out as ours, after each of samples (m, n, 11)."""
    from drone_estimators.filterpy import ukf_correct, ukf_predict, ukf_unscented_transform

    settings, data = _settings(vehicle, tuning), _start(vehicle, tuning, samples)
    out = np.zeros((*samples.shape[:2], STATE_SIZE))
    weights = settings.SPsettings
    for k in range(1, samples.shape[1]):
        data = ukf_predict(_measured(data, samples[:, k]), settings)
        expected, covariance = ukf_unscented_transform(
            data.sigmas_h, weights.Wm, weights.Wc, settings.R
        )
        error = (data.z - expected)[..., None]
        out[:, k, NIS] = np.sum(error * np.linalg.solve(covariance, error), axis=(-2, -1))
        data = ukf_correct(data, settings)
        for where, value in (
            (POSITION, data.pos),
            (QUATERNION, np.roll(data.quat, 1, axis=-1)),
            (VELOCITY, data.vel),
            (RATE, data.ang_vel),
            (TORQUE, data.dist_t),
            (FORCE, data.dist_f),
        ):
            out[:, k, where] = value
    return out


def _peer_stepper(vehicle: Vehicle, samples: Array, jit: bool) -> Callable[[], None]:
    """Return what takes the peer through samples (n, 11) of one flight, as its
    ``KalmanFilter.step`` does.
    """
    import jax
    from drone_estimators.filterpy import ukf_predict_correct

    tuning = UKFTuning.for_vehicle(vehicle, TICK)
    update = partial(ukf_predict_correct, settings=_settings(vehicle, tuning))
    if jit:
        update = jax.jit(update)

    def go() -> None:
        data = _start(vehicle, tuning, samples)
        for sample in samples[1:]:
            data = update(_measured(data, sample))
        jax.block_until_ready(data.pos)

    return go


def _our_stepper(estimator: WrenchUKF | NonlinearObserver, samples: Array) -> Callable[[], None]:
    def go() -> None:
        estimator.reset(samples[0, 4:7], samples[0, 7:11])
        for sample in samples[1:]:
            estimator.step(sample[:4], sample[4:7], sample[7:11])

    return go


def _times(samples: Array, peer: bool) -> dict[str, float]:
    """Return the time of a step from Python in us, the median of interleaved rounds over samples
    (n, 11).
    """
    vehicle = vehicle_at("low")
    steppers = {
        "UKF": _our_stepper(WrenchUKF(vehicle, None, TICK), samples),
        "EKF": _our_stepper(WrenchEKF(vehicle, None, TICK), samples),
        "observer": _our_stepper(NonlinearObserver(vehicle, None, TICK), samples),
    }
    if peer:
        steppers["drone-estimators"] = _peer_stepper(vehicle, samples, jit=False)
        steppers["drone-estimators, jax compiled"] = _peer_stepper(vehicle, samples, jit=True)
    for go in steppers.values():
        go()  # compiles
    taken: dict[str, list[float]] = {name: [] for name in steppers}
    for _ in range(_ROUNDS):
        for name, go in steppers.items():
            begin = time.perf_counter()
            go()
            taken[name].append((time.perf_counter() - begin) / (len(samples) - 1))
    return {name: 1e6 * float(np.median(values)) for name, values in taken.items()}


def main(arguments: Sequence[str]) -> None:
    """Read samples, write states and times."""
    source, target, *words = arguments
    with np.load(source) as data:
        samples = {name.removeprefix("samples_"): data[name] for name in data.files}
    out: dict[str, Array] = {}
    peer = installed()
    if peer:
        # jax compiles for timing alone; what is scored runs in NumPy, in 64 bit
        for noise, values in samples.items():
            vehicle = vehicle_at(noise)
            out[f"states_{noise}"] = _run(vehicle, UKFTuning.for_vehicle(vehicle, TICK), values)
    times = _times(next(iter(samples.values()))[0, : _TIMED_STEPS + 1], peer) if words else {}
    np.savez(target, names=np.array(list(times)), times=np.array(list(times.values())), **out)  # type: ignore[arg-type]


if __name__ == "__main__":
    main(sys.argv[1:])
