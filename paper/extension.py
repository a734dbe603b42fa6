"""What the paper names but does not do: inertial sensors, a position alone, and the mass as a
state.

Vehicles in closed loop in the plant; the filters run on the recorded samples. First, a step of
force and torque at hover, measured with the paper's high noise: rise time against the spread of the
settled estimate for four sets of sensors. Then a vehicle that weighs 53 g more than declared: what
the wrench filter and the filter with a mass make of it.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from ..dynamics.vehicle import Mocap, Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..envs.closed_loop import ClosedLoop
from ..envs.plant import NOISE, TICK, PlantSettings
from ..envs.recording import record_flight
from ..estimator import UKFTuning, WrenchMassUKF, WrenchUKF
from .result import Comparison, Progress, Result

Array = NDArray[np.float64]

TITLE = "Extension: inertial sensors, position alone, and the mass as a state"
SEEDS = 4

FORCE, TORQUE = np.array([0.0, 0.2, -0.52]), np.array([0.067, 0.0, 0.0])
STEP_AT, SECONDS = 7.0, 17.0
GYRO, ACCELEROMETER = 0.005, 0.05  # rad/s and m/s2, one sample
NOISE_LEVEL = Mocap(200.0, 0.01, 0.05)
RISE_TIMES = (0.1, 0.2, 0.4, 0.8, 1.6)
TRUST = (
    0.03,
    0.1,
    0.3,
)  # of the model: thrust_noise relative to 1 N, and motor_torque_noise to 0.1 Nm
SETS = {
    "pose": (True, False, False),
    "pose, gyro": (True, True, False),
    "pose, gyro, accelerometer": (True, True, True),
    "position, gyro, accelerometer": (False, True, True),
}
COLOURS = dict(zip(SETS, ("#d1495b", "#edae49", "#30638e", "#66a182"), strict=True))
# of lines and dots: where curves lie on one another, an earlier one shows on both sides of the next
WIDTHS = (5.2, 3.8, 2.4, 1.0)
EXTRA_MASS = 0.053  # kg


@dataclass(frozen=True)
class Samples:
    """One flight's samples: rotor speeds (n, 4), position, quaternion, gyro, accelerometer."""

    speeds: Array
    position: Array
    quaternion: Array
    gyro: Array
    accelerometer: Array


def fly_step(vehicle: Vehicle, seed: int, seconds: float = SECONDS) -> Samples:
    """Hover in the plant, without unmodelled disturbance, and put the wrench on at 7 s."""
    rng = np.random.default_rng(seed)
    loop = ClosedLoop(
        vehicle,
        tuning=UKFTuning.for_vehicle(vehicle),
        settings=PlantSettings(disturbance_force=0.0, disturbance_torque=0.0),
    )
    loop.reset(rng, np.array([0.0, 0.0, 1.2]))
    count = round(seconds / TICK)
    out = {
        name: np.empty((count, size))
        for name, size in (
            ("speeds", 4),
            ("position", 3),
            ("quaternion", 4),
            ("gyro", 3),
            ("accelerometer", 3),
        )
    }
    for k in range(count):
        if k * TICK >= STEP_AT:
            loop.applied[:3], loop.applied[3:] = FORCE, TORQUE
        plant = loop.record[0]["plant"]
        out["speeds"][k] = loop.sample[:4]
        # what the sensors feel at the end of the interval whose rotor speeds these are
        specific = (
            plant["rotation"].T @ loop.external[:3] + [0.0, 0.0, plant["rotor_wrench"][0]]
        ) / vehicle.mass
        rate = np.array(loop.data.qvel[3:6])
        loop.run(rng.standard_normal((1, NOISE)))
        out["position"][k], out["quaternion"][k] = loop.sample[4:7], loop.sample[7:]
        out["gyro"][k] = rate + GYRO * rng.standard_normal(3)
        out["accelerometer"][k] = specific + ACCELEROMETER * rng.standard_normal(3)
    return Samples(**out)


def run_filter(
    vehicle: Vehicle,
    samples: Samples,
    sensors: tuple[bool, bool, bool],
    rise_time: float,
    trust: float,
) -> tuple[Array, Array]:
    """Return the estimated force and torque, (n, 3) each, with the sensors attitude, gyro and
    accelerometer or not.
    """
    attitude, gyro, accelerometer = sensors
    base = UKFTuning.for_vehicle(vehicle, TICK, rise_time)
    # the ratio of walk to white noise sets the rise time; trust scales both
    scale = trust / 0.3
    tuning = replace(
        base,
        gyro_noise=GYRO,
        accelerometer_noise=ACCELEROMETER,
        **{
            name: getattr(base, name) * scale
            for name in ("thrust_noise", "force_walk", "motor_torque_noise", "torque_walk")
        },
    )
    ukf = WrenchUKF(vehicle, tuning, TICK)
    ukf.reset(samples.position[1], samples.quaternion[1])
    force, torque = np.zeros_like(samples.gyro), np.zeros_like(samples.gyro)
    for k in range(2, len(force)):
        estimate = ukf.step(
            samples.speeds[k], samples.position[k], samples.quaternion[k] if attitude else None
        )
        if gyro:
            estimate = ukf.correct_imu(
                samples.gyro[k], samples.accelerometer[k] if accelerometer else None
            )
        force[k], torque[k] = estimate.force, estimate.torque
    return force, torque


def rise_time_of(curve: Array, target: float) -> float:
    """Return the 10-90 % rise time (s) of a mean curve (n,) that steps at 7 s to ``target``; NaN if
    it never rises.
    """
    share = curve[round(STEP_AT / TICK) :] / target
    if not np.any(share > 0.9):
        return float("nan")
    return float(TICK * (np.argmax(share > 0.9) - np.argmax(share > 0.1)))


def sweep(seeds: int, progress: Progress) -> list[dict[str, Any]]:
    """Return rise time and spread of force and torque for every set of sensors, rise-time setting
    and trust.
    """
    vehicle = replace(load_vehicle("ardrone2"), mocap=NOISE_LEVEL)
    flights = [fly_step(vehicle, seed) for seed in range(seeds)]
    rows: list[dict[str, Any]] = []
    settled = slice(round(12.0 / TICK), None)
    total = len(SETS) * len(RISE_TIMES) * len(TRUST)
    for name, sensors in SETS.items():
        for rise in RISE_TIMES:
            for trust in TRUST:
                runs = [run_filter(vehicle, samples, sensors, rise, trust) for samples in flights]
                force, torque = (np.array([r[i] for r in runs]) for i in range(2))
                rows.append(
                    {
                        "sensors": name,
                        "setting_s": rise,
                        "trust_N": trust,
                        "force_rise_s": rise_time_of(force[:, :, 2].mean(0), FORCE[2]),
                        "torque_rise_s": rise_time_of(torque[:, :, 0].mean(0), TORQUE[0]),
                        "lateral_rise_s": rise_time_of(force[:, :, 1].mean(0), FORCE[1]),
                        "force_std_N": float(
                            np.sqrt(np.mean((force[:, settled, 2] - FORCE[2]) ** 2))
                        ),
                        "lateral_std_N": float(
                            np.sqrt(np.mean((force[:, settled, 1] - FORCE[1]) ** 2))
                        ),
                        "torque_std_Nm": float(
                            np.sqrt(np.mean((torque[:, settled, 0] - TORQUE[0]) ** 2))
                        ),
                    }
                )
                progress(0.8 * len(rows) / total)
    return rows


def frontier(rows: list[dict[str, Any]], sensors: str, rise: str, spread: str) -> Array:
    """Return the settings (n, 2) of rise time and spread that no other setting beats in both, by
    rise time.
    """
    points = np.array(
        sorted(
            (r[rise], r[spread]) for r in rows if r["sensors"] == sensors and np.isfinite(r[rise])
        )
    )
    best, kept = np.inf, []
    for point in points:
        if point[1] < best:
            best = point[1]
            kept.append(point)
    return np.array(kept).reshape(-1, 2)


def rise_at(curve: Array, spread: float) -> float:
    """Return the shortest rise time (s) on a frontier (n, 2) whose spread is no larger than given;
    NaN if there is none.
    """
    good = curve[curve[:, 1] <= spread]
    return float(good[0, 0]) if len(good) else float("nan")


def weigh(trajectory: str, seed: int, seconds: float = 20.0) -> dict[str, Array]:
    """Fly with 53 g more than declared; return time, mass and vertical force as both filters see
    them.
    """
    vehicle = load_vehicle("ardrone2")
    heavy = replace(vehicle, mass=vehicle.mass + EXTRA_MASS)
    log = record_flight(heavy, (), trajectory, seconds, seed)
    tuning = UKFTuning()
    plain = WrenchUKF(vehicle, tuning, TICK)
    # next to nothing vertical but weight is expected, so the mass may take it
    massive = WrenchMassUKF(vehicle, replace(tuning, force_walk=(3.26e-3, 3.26e-3, 1e-4)), TICK)
    for ukf in (plain, massive):
        ukf.reset(log["position"][0], log["quaternion"][0])
    rows = np.empty((len(log["t"]), 4))
    rows[0] = 0.0, 0.0, vehicle.mass, massive.mass_std
    for k in range(1, len(rows)):
        sample = log["rotor_speeds"][k], log["position"][k], log["quaternion"][k]
        rows[k] = (
            plain.step(*sample).force[2],
            massive.step(*sample).force[2],
            massive.mass,
            massive.mass_std,
        )
    return {
        "t": log["t"],
        "plain_fz": rows[:, 0],
        "massive_fz": rows[:, 1],
        "mass": rows[:, 2],
        "mass_std": rows[:, 3],
    }


def run(seeds: int, progress: Progress) -> Result:
    """Run both parts over ``seeds`` flights."""
    rows = sweep(seeds, progress)
    scales: list[dict[str, Any]] = []
    shown: dict[str, dict[str, Array]] = {}
    for i, trajectory in enumerate(("hover", "excite")):
        flights = [weigh(trajectory, seed) for seed in range(seeds)]
        shown[trajectory] = flights[0]
        last = slice(-round(5.0 / TICK), None)
        scales.append(
            {
                "trajectory": trajectory,
                "mass_error_g": float(
                    1e3 * np.mean([f["mass"][-1] for f in flights]) - 1e3 * (0.465 + EXTRA_MASS)
                ),
                "mass_std_over_seeds_g": float(1e3 * np.std([f["mass"][-1] for f in flights])),
                "mass_std_of_filter_g": float(1e3 * np.mean([f["mass_std"][-1] for f in flights])),
                "plain_fz_mean_N": float(np.mean([f["plain_fz"][last].mean() for f in flights])),
                "plain_fz_std_N": float(np.mean([f["plain_fz"][last].std() for f in flights])),
                "massive_fz_mean_N": float(
                    np.mean([f["massive_fz"][last].mean() for f in flights])
                ),
                "massive_fz_std_N": float(np.mean([f["massive_fz"][last].std() for f in flights])),
            }
        )
        progress(0.8 + 0.1 * (i + 1))
    gains = {}
    comparison = []
    for what, rise, spread, unit, scale in (
        ("vertical force", "force_rise_s", "force_std_N", "mN", 1e3),
        ("lateral force", "lateral_rise_s", "lateral_std_N", "mN", 1e3),
        ("torque", "torque_rise_s", "torque_std_Nm", "mNm", 1e3),
    ):
        curves = {name: frontier(rows, name, rise, spread) for name in SETS}
        (usual,) = (
            r for r in rows if (r["sensors"], r["setting_s"], r["trust_N"]) == ("pose", 0.8, 0.1)
        )
        level = usual[spread]
        gains[what] = {
            "spread": level,
            "rise_s": {name: rise_at(curve, 1.001 * level) for name, curve in curves.items()},
        }
        comparison.append(
            Comparison(
                f"rise time (s) of the {what} at a spread of {scale * level:.2g} {unit}",
                "-",
                "; ".join(f"{name}: {value:.2f}" for name, value in gains[what]["rise_s"].items()),
            )
        )
    for row in scales:
        comparison.append(
            Comparison(
                f"53 g too heavy, {row['trajectory']}: mass error (g); vertical force (N) with and "
                f"without the mass",
                "-",
                f"{row['mass_error_g']:+.1f}; {row['massive_fz_mean_N']:+.3f}, "
                f"{row['plain_fz_mean_N']:+.3f}",
            )
        )
    data = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    return Result(
        {"rise_at_equal_spread": gains, "mass": scales},
        data,
        _draw(rows, shown),
        comparison,
        [
            "The paper says that the filter extends to further sensors and to mass and inertia, "
            "and shows neither. Where the pose is noisy, a gyro improves the torque and an "
            "accelerometer the force. With both, the attitude need not be measured at all for the "
            "two horizontal axes.",
            "At hover an unknown mass and a vertical force are the same: the split is decided by "
            "the tuning, not by the data. "
            "A flight with vertical acceleration tells them apart.",
        ],
    )


def _draw(rows: list[dict[str, Any]], shown: dict[str, dict[str, Array]]) -> Figure:
    figure = Figure(figsize=(11, 8), layout="constrained")
    panels = figure.subplots(2, 2)
    for axes, what, rise, spread, scale, unit in (
        (panels[0, 0], "Vertical force", "force_rise_s", "force_std_N", 1e3, "mN"),
        (panels[0, 1], "Roll torque", "torque_rise_s", "torque_std_Nm", 1e3, "mNm"),
    ):
        for name, width in zip(SETS, WIDTHS, strict=True):
            curve = frontier(rows, name, rise, spread)
            axes.loglog(
                curve[:, 0],
                scale * curve[:, 1],
                "o-",
                color=COLOURS[name],
                label=name,
                lw=width,
                ms=2.0 + 1.3 * width,
            )
        axes.set_title(f"{what}: faster at the same spread with an IMU", loc="left", fontsize=11)
        axes.set_xlabel("10-90 % rise time (s)")
        axes.set_ylabel(f"settled error, RMS ({unit})")
        axes.grid(alpha=0.3, which="both")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
    panels[0, 0].legend(frameon=False, fontsize=9)
    for axes, trajectory in zip(panels[1], shown, strict=True):
        flight = shown[trajectory]
        axes.plot(
            flight["t"], flight["plain_fz"], color="#d1495b", lw=1.5, label="force, wrench filter"
        )
        axes.plot(
            flight["t"],
            flight["massive_fz"],
            color="#30638e",
            lw=1.5,
            label="force, filter with mass",
        )
        axes.axhline(-EXTRA_MASS * 9.81, color="#d1495b", lw=0.8, ls=":")
        axes.set_ylim(-0.8, 0.4)
        axes.set_ylabel("estimated vertical force (N)")
        axes.set_xlabel("time (s)")
        axes.set_title(f"53 g heavier than declared: {trajectory}", loc="left", fontsize=11)
        twin = axes.twinx()
        grams = 1e3 * (flight["mass"] - 0.465)
        axes.plot([], [], color="#2b2b2b", lw=1.5, label="mass (right axis)")
        twin.plot(flight["t"], grams, color="#2b2b2b", lw=1.5)
        twin.fill_between(
            flight["t"],
            grams - 2e3 * flight["mass_std"],
            grams + 2e3 * flight["mass_std"],
            color="#2b2b2b",
            alpha=0.12,
            lw=0,
        )
        twin.axhline(1e3 * EXTRA_MASS, color="#2b2b2b", lw=0.8, ls=":")
        twin.set_ylim(-20, 100)
        twin.set_ylabel("extra mass, estimated (g), 2 sigma")
    panels[1, 0].legend(frameon=False, fontsize=9, loc="lower right")
    return figure
