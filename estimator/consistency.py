"""Is a filter as good as it says? Its errors against its own covariance, on truth drawn from its
own model.

Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4: the normalised estimation error squared (NEES) of a consistent filter is chi-squared
with as many degrees of freedom as the state has (18), the normalised innovation squared (NIS) with
as many as the measurement has (6).
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.stats import chi2

from ..dynamics.rotation import attitude_error, normalise, quaternion_from_mrp, quaternion_multiply
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled
from ..runtime.errors import InputError
from .estimate import FORCE, POSITION, QUATERNION, RATE, TORQUE, VELOCITY, Array, WrenchEstimate
from .filter_record import BIASES, N, drive, filter_record, propagate
from .imu import expected_imu
from .tuning import UKFTuning
from .ukf import default_covariance

MEASURED = 6  # numbers in a pose


def state_error(
    estimate: WrenchEstimate,
    true_position: ArrayLike,
    true_quaternion: ArrayLike,
    true_velocity: ArrayLike,
    true_angular_velocity: ArrayLike,
    true_torque: ArrayLike,
    true_force: ArrayLike,
) -> Array:
    """Return truth minus estimate (18,), in the order of the covariance: (rho, omega, x, v, torque,
    force).

    rho is the world-frame MRP that turns the estimated attitude into the true one; positions are in
    m, velocities in m/s (world), body rates in rad/s, torque in Nm and force in N (world).
    """
    error = np.empty(N)
    attitude_error(np.asarray(true_quaternion, dtype=np.float64), estimate.quaternion, error[0:3])
    error[3:6] = np.subtract(true_angular_velocity, estimate.angular_velocity)
    error[6:9] = np.subtract(true_position, estimate.position)
    error[9:12] = np.subtract(true_velocity, estimate.velocity)
    error[12:15] = np.subtract(true_torque, estimate.torque)
    error[15:18] = np.subtract(true_force, estimate.force)
    return error


def nees(
    estimate: WrenchEstimate,
    true_position: ArrayLike,
    true_quaternion: ArrayLike,
    true_velocity: ArrayLike,
    true_angular_velocity: ArrayLike,
    true_torque: ArrayLike,
    true_force: ArrayLike,
) -> float:
    """Return the normalised estimation error squared of one estimate; see ``state_error`` for the
    arguments.
    """
    error = state_error(
        estimate,
        true_position,
        true_quaternion,
        true_velocity,
        true_angular_velocity,
        true_torque,
        true_force,
    )
    return float(error @ np.linalg.solve(estimate.covariance, error))


def chi2_band(dof: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the band in which the mean of ``runs`` independent chi-squared numbers lies with
    ``probability``.

    Raises:
        InputError: an argument out of range.
    """
    if dof < 1 or runs < 1 or not 0.0 < probability < 1.0:
        raise InputError(
            "chi2_band: expected dof and runs of at least 1 and a probability between 0 and 1, got "
            f"{dof}, {runs}, {probability}"
        )
    tail = 0.5 * (1.0 - probability)
    return float(chi2.ppf(tail, dof * runs)) / runs, float(chi2.ppf(1.0 - tail, dof * runs)) / runs


@dataclass(frozen=True, eq=False)
class ConsistencyReport:
    """What ``check_consistency`` found; every band holds a mean over the runs with
    ``probability``.

    Attributes:
        probability: of the bands, 0.95 for one.
        runs: how many.
        nees: (K,) mean over the runs, step by step.
        nis: (K,) likewise.
        nees_band: for one entry of ``nees``.
        nis_band: for one entry of ``nis``.
        nees_fraction: of the steps within the band.
        nis_fraction: likewise, of ``nis``.
        mean_nees: over runs and steps.
        mean_nis: likewise.
        mean_nis_band: for ``mean_nis``: a consistent filter's innovations are independent.
    """

    probability: float
    runs: int
    nees: Array
    nis: Array
    nees_band: tuple[float, float]
    nis_band: tuple[float, float]
    nees_fraction: float
    nis_fraction: float
    mean_nees: float
    mean_nis: float
    mean_nis_band: tuple[float, float]

    @property
    def consistent(self) -> bool:
        """Whether the mean NIS lies in the band of one step's mean, and the NEES does at 90 % of
        the steps or more.
        """
        return self.nis_band[0] <= self.mean_nis <= self.nis_band[1] and self.nees_fraction >= 0.9

    def __str__(self) -> str:
        percent = 100.0 * self.probability
        return (
            f"{self.runs} runs x {len(self.nees)} steps, {percent:g} % bands: "
            f"mean NIS {self.mean_nis:.3f} (one step "
            f"{self.nis_band[0]:.2f}-{self.nis_band[1]:.2f}, all steps "
            f"{self.mean_nis_band[0]:.3f}-{self.mean_nis_band[1]:.3f}), "
            f"{100.0 * self.nis_fraction:.1f} % of steps within; "
            f"mean NEES {self.mean_nees:.2f} ({self.nees_band[0]:.2f}-{self.nees_band[1]:.2f}), "
            f"{100.0 * self.nees_fraction:.1f} % of steps within"
        )


def check_consistency(
    nees_runs: ArrayLike,
    nis_runs: ArrayLike,
    probability: float = 0.95,
    dof: tuple[int, int] = (N, MEASURED),
) -> ConsistencyReport:
    """Return how the errors of R runs of K steps compare with what the filter says of them.

    Args:
        nees_runs: (R, K) NEES of independent runs.
        nis_runs: (R, K) NIS of the same runs.
        probability: of the bands.
        dof: degrees of freedom of NEES and NIS.

    Raises:
        InputError: the shapes differ or are not (R, K), or a number is not finite.
    """
    estimation, innovation = (
        np.asarray(nees_runs, dtype=np.float64),
        np.asarray(nis_runs, dtype=np.float64),
    )
    if estimation.ndim != 2 or estimation.shape != innovation.shape or estimation.size == 0:
        raise InputError(
            "check_consistency: expected two arrays of one shape (runs, steps), got "
            f"{estimation.shape} and {innovation.shape}"
        )
    if not (np.all(np.isfinite(estimation)) and np.all(np.isfinite(innovation))):
        raise InputError(
            "check_consistency: NEES and NIS must be finite; leave out steps without a measurement"
        )
    runs, steps = estimation.shape
    mean_nees, mean_nis = estimation.mean(axis=0), innovation.mean(axis=0)
    nees_band, nis_band = chi2_band(dof[0], runs, probability), chi2_band(dof[1], runs, probability)
    return ConsistencyReport(
        probability,
        runs,
        mean_nees,
        mean_nis,
        nees_band,
        nis_band,
        _fraction_within(mean_nees, nees_band),
        _fraction_within(mean_nis, nis_band),
        float(mean_nees.mean()),
        float(mean_nis.mean()),
        chi2_band(dof[1], runs * steps, probability),
    )


def _fraction_within(values: Array, band: tuple[float, float]) -> float:
    return float(np.mean((values >= band[0]) & (values <= band[1])))


def plot(report: ConsistencyReport, period: float, path: str | Path | None = None) -> Figure:
    """Return a picture of NEES and NIS over time with their bands; ``period`` in s. Written to
    ``path`` if given.
    """
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    top, bottom = figure.subplots(2, 1, sharex=True)
    time = period * np.arange(1, len(report.nees) + 1)
    for axes, values, band, fraction, name in (
        (top, report.nees, report.nees_band, report.nees_fraction, "NEES"),
        (bottom, report.nis, report.nis_band, report.nis_fraction, "NIS"),
    ):
        axes.axhspan(*band, color="0.85", label=f"{100.0 * report.probability:g} % band")
        axes.plot(
            time,
            values,
            linewidth=0.8,
            label=f"mean of {report.runs} runs, {100.0 * fraction:.1f} % within",
        )
        axes.set_ylabel(name)
        axes.legend(loc="upper right", fontsize="small")
    bottom.set_xlabel("time (s)")
    if path is not None:
        canvas.print_figure(str(path), dpi=150)
    return figure


@dataclass(frozen=True, eq=False)
class ModelRun:
    """A flight drawn from the filter's own model: truth and measurement at the end of each of K
    steps.

    Attributes:
        initial_position: (3,) m, what the filter is to start with; the truth is drawn around it.
        initial_quaternion: (4,)
        initial_velocity: (3,) m/s, world.
        initial_angular_velocity: (3,) rad/s, body.
        initial_covariance: (18, 18)
        rotor_speeds: (K, 4) rad/s.
        measured_position: (K, 3) m.
        measured_quaternion: (K, 4)
        position: (K, 3) m.
        quaternion: (K, 4)
        velocity: (K, 3) m/s, world.
        angular_velocity: (K, 3) rad/s, body.
        torque: (K, 3) Nm, world.
        force: (K, 3) N, world.
        gyro: (K, 3) rad/s, body, as measured.
        accelerometer: (K, 3) m/s2, body, as measured.
        gyro_bias: (K, 3) rad/s, in them.
        accelerometer_bias: (K, 3) m/s2.
    """

    initial_position: Array
    initial_quaternion: Array
    initial_velocity: Array
    initial_angular_velocity: Array
    initial_covariance: Array
    rotor_speeds: Array
    measured_position: Array
    measured_quaternion: Array
    position: Array
    quaternion: Array
    velocity: Array
    angular_velocity: Array
    torque: Array
    force: Array
    gyro: Array
    accelerometer: Array
    gyro_bias: Array
    accelerometer_bias: Array

    def truth(self, k: int) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return the true state after step ``k`` in the order in which ``nees`` takes it."""
        return (
            self.position[k],
            self.quaternion[k],
            self.velocity[k],
            self.angular_velocity[k],
            self.torque[k],
            self.force[k],
        )


def simulate_model(
    vehicle: Vehicle,
    tuning: UKFTuning,
    rotor_speeds: ArrayLike,
    period: float = 0.005,
    seed: int = 0,
    position: ArrayLike = (0.0, 0.0, 1.0),
    quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    covariance: ArrayLike | None = None,
    rate_gain: float = 20.0,
    push: ArrayLike | None = None,
) -> ModelRun:
    """Return a flight in which the filter's assumptions hold to the letter.

    Every step draws a rotor torque error (body frame) and a rotor force error (body frame), moves
    the external torque and force (world) by their walks, and measures the pose, all normal with the
    deviations of ``tuning``. The start is drawn from ``covariance`` about the given pose and twist,
    with no external wrench in the mean. Gyro and accelerometer measure at the end of each step;
    their biases are drawn from ``tuning`` and walk.

    Args:
        vehicle: with its declared effects.
        tuning: what the filter assumes of noise.
        rotor_speeds: (K, 4) rad/s, before the rate loop.
        period: s.
        seed: of the random numbers.
        position: (3,) m, world.
        quaternion: (4,) body to world, scalar first.
        velocity: (3,) m/s, world.
        angular_velocity: (3,) rad/s, body.
        covariance: (18, 18) of (rho, omega, x, v, torque, force); default
            ``default_covariance(vehicle, tuning)``.
        rate_gain: 1/s, of a loop on the true body rate about ``angular_velocity``, without which a
            walk of the torque spins the vehicle up; the rotor speeds that it asks for are those of
            the result. Position and attitude drift.
        push: (K, 6) Nm and N, world, that the external torque and force change by after each step
            beside their walks: what the filter does not expect.

    Raises:
        InputError: a shape is wrong.
    """
    speeds = np.array(rotor_speeds, dtype=np.float64)
    if (
        speeds.ndim != 2
        or speeds.shape[1] != 4
        or len(speeds) == 0
        or not np.all(np.isfinite(speeds))
    ):
        raise InputError(
            f"simulate_model: rotor_speeds must be finite and (K, 4), got shape {speeds.shape}"
        )
    P = (
        default_covariance(vehicle, tuning)
        if covariance is None
        else np.asarray(covariance, dtype=np.float64)
    )
    if P.shape != (N, N):
        raise InputError(f"simulate_model: covariance must be (18, 18), got shape {P.shape}")
    start = np.zeros(20)
    for where, value in (
        (POSITION, position),
        (QUATERNION, quaternion),
        (VELOCITY, velocity),
        (RATE, angular_velocity),
    ):
        start[where] = value
    rng = np.random.default_rng(seed)
    steps = len(speeds)
    process = rng.standard_normal((steps, 12))
    for n, deviation in enumerate(
        (tuning.motor_torque_noise, tuning.thrust_noise, tuning.torque_walk, tuning.force_walk)
    ):
        process[:, 3 * n : 3 * n + 3] *= np.asarray(deviation, dtype=np.float64)
    if push is not None:
        change = np.asarray(push, dtype=np.float64)
        if change.shape != (steps, 6):
            raise InputError(
                f"simulate_model: push must be ({steps}, 6) like rotor_speeds, got shape "
                f"{change.shape}"
            )
        process[:, 6:] += change
    measurement = rng.standard_normal((steps, MEASURED))
    measurement[:, :3] *= np.asarray(tuning.attitude_noise, dtype=np.float64) / 4.0  # (16)
    measurement[:, 3:] *= np.asarray(tuning.position_noise, dtype=np.float64)
    states, measured = np.empty((steps, 20)), np.empty((steps, 7))
    imu, biases = _inertial_noise(tuning, steps, seed)
    record = filter_record(vehicle, tuning, period)
    drawn = rng.multivariate_normal(np.zeros(N), P, method="cholesky")
    unmix = np.ascontiguousarray(np.linalg.inv(vehicle.mixing)[:, 1:]) @ vehicle.inertia * rate_gain
    _simulate(
        record,
        start,
        drawn,
        speeds,
        unmix,
        vehicle.omega_max,
        process,
        measurement,
        period,
        vehicle.voltage_ref,
        states,
        measured,
        imu,
    )
    return ModelRun(
        start[POSITION],
        start[QUATERNION],
        start[VELOCITY],
        start[RATE],
        P,
        speeds,
        measured[:, :3],
        measured[:, 3:],
        states[:, POSITION],
        states[:, QUATERNION],
        states[:, VELOCITY],
        states[:, RATE],
        states[:, TORQUE],
        states[:, FORCE],
        imu[:, :3],
        imu[:, 3:],
        biases[:, :3],
        biases[:, 3:],
    )


def _inertial_noise(tuning: UKFTuning, steps: int, seed: int) -> tuple[Array, Array]:
    """Return what gyro and accelerometer (K, 6) measure beside the truth, and the biases in it."""
    rng = np.random.default_rng([seed, 1])

    def deviations(gyro: ArrayLike, accelerometer: ArrayLike) -> Array:
        return np.concatenate([np.broadcast_to(gyro, 3), np.broadcast_to(accelerometer, 3)])

    walk = rng.standard_normal((steps, BIASES))
    walk *= deviations(tuning.gyro_bias_walk, tuning.accelerometer_bias_walk)
    walk[0] += rng.standard_normal(BIASES) * deviations(
        tuning.gyro_bias_std, tuning.accelerometer_bias_std
    )
    biases = np.cumsum(walk, axis=0)
    white = rng.standard_normal((steps, BIASES))
    return biases + white * deviations(tuning.gyro_noise, tuning.accelerometer_noise), biases


@compiled
def _simulate(
    record: Record,
    start: Array,
    error: Array,
    speeds: Array,
    rate_loop: Array,
    fastest: float,
    process: Array,
    measurement: Array,
    dt: float,
    voltage: float,
    states: Array,
    measured: Array,
    imu: Array,
) -> None:
    f = record[0]
    x, after = f.x, f.next
    inertial = np.empty(6)
    quaternion_from_mrp(error[0:3], f.q)
    quaternion_multiply(f.q, start[3:7], x[3:7])
    normalise(x[3:7])
    for i in range(3):
        x[i] = start[i] + error[6 + i]
        x[7 + i] = start[7 + i] + error[9 + i]
        x[10 + i] = start[10 + i] + error[3 + i]
        x[13 + i] = error[12 + i]
        x[16 + i] = error[15 + i]
    for k in range(len(speeds)):
        noise = process[k]
        for i in range(4):
            square = speeds[k, i] * speeds[k, i]
            for j in range(3):
                square += rate_loop[i, j] * (start[10 + j] - x[10 + j])
            speeds[k, i] = min(math.sqrt(max(square, 0.0)), fastest)
        drive(f, speeds[k], dt, voltage)
        for i in range(3):
            f.rotor_wrench[1 + i] += noise[i]
        propagate(f, x, dt, after)
        # the force error is in the body frame and acts through the mass alone
        for i in range(3):
            push = (
                f.rotation[i, 0] * noise[3]
                + f.rotation[i, 1] * noise[4]
                + f.rotation[i, 2] * noise[5]
            )
            push *= dt / f.body.mass
            after[i] += 0.5 * dt * push
            after[7 + i] += push
            after[13 + i] += noise[6 + i]
            after[16 + i] += noise[9 + i]
        normalise(after[3:7])
        for i in range(19):
            x[i] = after[i]
        f.time += dt
        states[k] = x
        quaternion_from_mrp(measurement[k, 0:3], f.q)
        quaternion_multiply(f.q, x[3:7], measured[k, 3:7])
        for i in range(3):
            measured[k, i] = x[i] + measurement[k, 3 + i]
        # the accelerometer feels the step's noise: the torque's is in the rotors' wrench already
        expected_imu(f, x, inertial)
        for i in range(3):
            imu[k, i] += inertial[i]
            imu[k, 3 + i] += inertial[3 + i] + noise[3 + i] / f.body.mass
