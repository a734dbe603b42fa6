"""Fig. 4, step response: 53 g is hung on under the front rotors at 7 s, and the estimates of force
and torque rise.

The filter's tuning trades rise time against noise; the sweep gives the curve from which a user
chooses. Every flight is paired with one that sees the same noise but has no mass hung on: the
difference of the two is the response to the mass alone, and the second tells the noise.

The thread really pulls sideways when the vehicle tips and slides. The lateral estimate itself is
held against the bound; what it has beyond that true pull, as the filter would show it, is the
lateral force that the filter makes up.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..envs.plant import PlantSettings
from .fig4_picture import Step, draw
from .hanging_mass import CALM, ROTOR_LOAD, THREAD, hover, with_noise
from .result import Comparison, Progress, Result, remarks

TITLE = "Fig. 4: step response to a known mass"
SEEDS = 6

Array = NDArray[np.float64]
HANG = 7.0  # s
_END = 20.0  # s
_EVERY = 2  # ticks
_TRANSIENT = 5.0  # s after the mass is hung on, in which the lateral force is watched
NOISES = ((0.001, 0.005), (0.01, 0.05))  # m, rad: motion capture, and a vision system
SWEEP = (0.25, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)  # s, tuned rise times
_SHOWN = (0.5, 1.0, 2.0)  # s, drawn over time and held against the requirement
_RISE, _RISE_BOUND, _LATERAL_BOUND = 1.0, 0.2, 0.1  # s, s, N


def run(seeds: int, progress: Progress, sweep: Sequence[float] = SWEEP) -> Result:
    """Fly the step at every tuning of ``sweep`` (s), at both noise levels, with and without
    actuator noise.
    """
    vehicle = load_vehicle("ardrone2")
    steps = []
    for noise in NOISES:
        for actuator in (True, False):
            for tuned in sweep:
                steps.append(fly_step(vehicle, noise, actuator, tuned, seeds))
                progress(len(steps) / (len(NOISES) * 2 * len(sweep)))
    rows = [_row(step) for step in steps]
    shown = [step for step in steps if step.actuator and step.tuned in _SHOWN]
    held = [row for row in rows if row["actuator_noise"]]
    figures = {
        "rise_within_bounds": all(
            abs(row[name] - _RISE) <= _RISE_BOUND
            for row in held
            if row["tuned_rise_s"] == _RISE
            for name in ("force_rise_s", "torque_rise_s")
        ),
        "lateral_within_bounds": all(row["lateral_N"] <= _LATERAL_BOUND for row in rows),
        "sweep": rows,
    }
    columns = [_columns(step) for step in shown]
    data = {name: np.concatenate([some[name] for some in columns]) for name in columns[0]}
    return Result(
        figures, data, draw(steps, _SHOWN, _LATERAL_BOUND), _compare(rows), _remarks(rows)
    )


def _columns(step: Step) -> dict[str, NDArray[np.generic]]:
    same = np.ones(len(step.time))
    return {
        "noise_m": step.noise[0] * same,
        "noise_rad": step.noise[1] * same,
        "tuned_rise_s": step.tuned * same,
        "t_s": step.time,
        "force_z_N": step.force,
        "torque_pitch_Nm": step.torque,
        "force_lateral_N": step.lateral,
        "true_force_z_N": step.pull[:, 0],
        "true_torque_pitch_Nm": step.pull[:, 1],
        "true_force_lateral_N": step.pull[:, 2],
    }


def fly_step(
    vehicle: Vehicle, noise: tuple[float, float], actuator: bool, tuned: float, seeds: int
) -> Step:
    """Fly the step and its pair without the mass with each seed."""
    settings = PlantSettings() if actuator else CALM
    flier = with_noise(vehicle, *noise)
    hung, bare = (
        [hover(flier, load, _END, HANG, seed, tuned, settings, _EVERY) for seed in range(seeds)]
        for load in (ROTOR_LOAD, None)
    )
    time = hung[0].time
    force, torque = np.array([f.force for f in hung]), np.array([f.torque for f in hung])
    bare_force, bare_torque = np.array([f.force for f in bare]), np.array([f.torque for f in bare])
    pull: Array = np.array([f.pull for f in hung]).mean(axis=0)
    settled, transient = time >= 3.0, (time >= HANG) & (time < HANG + _TRANSIENT)
    rise, rise_error = zip(
        *(
            _with_error(lambda mean: rise_time(time, mean), response)
            for response in (
                force[..., 2] - bare_force[..., 2],
                torque[..., 1] - bare_torque[..., 1],
            )
        ),
        strict=True,
    )
    response = force[..., :2] - bare_force[..., :2]
    peak, peak_error = _with_error(lambda mean: float(_size(mean)[transient].max()), response)
    made_up = response.mean(axis=0) - as_shown(
        time, (force - bare_force)[..., 2].mean(axis=0), pull[:, :2]
    )
    return Step(
        noise,
        actuator,
        tuned,
        time,
        force[..., 2].mean(axis=0),
        torque[..., 1].mean(axis=0),
        _size(response.mean(axis=0)),
        np.stack([pull[:, 2], pull[:, 4], _size(pull)], axis=1),
        (rise[0], rise[1]),
        (rise_error[0], rise_error[1]),
        peak,
        peak_error,
        float(_size(force.mean(axis=0))[transient].max()),
        float(_size(made_up)[transient].max()),
        (float(bare_force[:, settled, 2].std()), float(bare_torque[:, settled, 1].std())),
        float(_size(force)[:, transient].max()),
        float(_size(bare_force)[:, transient].max()),
    )


def _size(vectors: Array) -> Array:
    """Return the length (...,) of the level part of vectors (..., 2 or more)."""
    size: Array = np.hypot(vectors[..., 0], vectors[..., 1])
    return size


def rise_time(time: Array, response: Array) -> float:
    """Return the time (s) from 10 to 90 % of a step response (n,), which ends at its mean over the
    last 5 s.
    """
    share = response / response[time >= time[-1] - 5.0].mean()
    last = int(np.argmax(share >= 0.9))
    # noise may cross 10 % more than once: the last time before 90 %
    first = int(np.flatnonzero(share[:last] < 0.1)[-1]) + 1
    return _cross(time, share, last, 0.9) - _cross(time, share, first, 0.1)


def as_shown(time: Array, response: Array, pull: Array) -> Array:
    """Return what a filter shows of a true pull (n, m) N, from its response (n,) N along z to the
    mass hung on at ``HANG``.

    To the filter the axes are alike as far as it knows its attitude: a pull is smoothed by the
    slope of the step response.
    """
    after = time >= HANG
    slope = np.diff(response[after] / response[time >= time[-1] - 5.0].mean(), prepend=0.0)
    shown = np.zeros_like(pull)
    for axis in range(pull.shape[1]):
        shown[after, axis] = np.convolve(pull[after, axis], slope)[: len(slope)]
    return shown


def _cross(time: Array, share: Array, i: int, level: float) -> float:
    """Return when the straight line between samples i - 1 and i reaches a level."""
    return float(
        time[i - 1] + (level - share[i - 1]) / (share[i] - share[i - 1]) * (time[i] - time[i - 1])
    )


def _with_error(number: Callable[[Array], float], responses: Array) -> tuple[float, float]:
    """Return a number of the mean of responses (seeds, n, ...), and its standard error by the
    jackknife.
    """
    value, count = number(responses.mean(axis=0)), len(responses)
    if count == 1:
        return value, float("nan")
    left_out = [number(np.delete(responses, i, axis=0).mean(axis=0)) for i in range(count)]
    return value, float(np.sqrt((count - 1) * np.var(left_out)))


def _row(step: Step) -> dict[str, Any]:
    errors = [
        None if np.isnan(error) else error for error in (*step.rise_error, step.peak_error)
    ]  # JSON has no NaN
    after = step.time >= HANG
    return {
        "position_noise_m": step.noise[0],
        "attitude_noise_rad": step.noise[1],
        "actuator_noise": step.actuator,
        "tuned_rise_s": step.tuned,
        "force_rise_s": step.rise[0],
        "force_rise_error_s": errors[0],
        "torque_rise_s": step.rise[1],
        "torque_rise_error_s": errors[1],
        "force_std_N": step.std[0],
        "torque_std_Nm": step.std[1],
        "lateral_N": step.peak,
        "lateral_error_N": errors[2],
        "unpaired_lateral_N": step.unpaired_peak,
        "made_up_lateral_N": step.made_up,
        "true_lateral_N": float(step.pull[after, 2].max()),
        "worst_flight_lateral_N": step.worst_lateral,
        "worst_flight_lateral_without_mass_N": step.calm_lateral,
    }


def _name(row: dict[str, Any]) -> str:
    return f"{row['position_noise_m'] * 1e3:.0f} mm, {row['attitude_noise_rad'] * 1e3:.0f} mrad"


def _compare(rows: Sequence[dict[str, Any]]) -> list[Comparison]:
    lines = []
    held = [row for row in rows if row["actuator_noise"] and row["tuned_rise_s"] in _SHOWN]
    for row in held:
        if row["tuned_rise_s"] == _RISE:
            lines.append(
                Comparison(
                    f"rise time of force, torque (s) at {_name(row)}",
                    "about 1, 1",
                    f"{row['force_rise_s']:.2f}, {row['torque_rise_s']:.2f}",
                )
            )
            lines.append(
                Comparison(
                    f"standard deviation (N, Nm) at {_name(row)}",
                    "-",
                    f"{row['force_std_N']:.3f}, {row['torque_std_Nm']:.4f}",
                )
            )
    if rows:
        worst = max(rows, key=lambda row: float(row["lateral_N"]))
        tuned = [float(row["tuned_rise_s"]) for row in rows]
        lines.append(
            Comparison(
                f"largest lateral-force transient (N), tuned to {min(tuned):g} to {max(tuned):g} s",
                "-",
                f"{worst['lateral_N']:.3f} ({worst['tuned_rise_s']:g} s, {_name(worst)})",
            )
        )
        lines.append(
            Comparison(
                "of it beyond the thread's true sideways pull, largest (N)",
                "-",
                f"{max(row['made_up_lateral_N'] for row in rows):.3f}",
            )
        )
    return lines


def _remarks(rows: Sequence[dict[str, Any]]) -> list[str]:
    worst, lateral = (
        max(rows, key=lambda row, name=name: float(row[name]))  # type: ignore[misc]
        for name in ("worst_flight_lateral_N", "lateral_N")
    )
    over = [
        row
        for row in rows
        if row["lateral_N"] + 2 * (row["lateral_error_N"] or 0.0) > _LATERAL_BOUND
    ]
    quiet = {
        (row["tuned_rise_s"], row["position_noise_m"]): row
        for row in rows
        if not row["actuator_noise"]
    }
    return remarks(
        "fig4",
        rows=rows,
        name=_name,
        worst=worst,
        lateral=lateral,
        over=over,
        thread=THREAD,
        transient=_TRANSIENT,
        bound=_LATERAL_BOUND,
        clean=quiet.get((_RISE, NOISES[0][0])),
        noisy=quiet.get((_RISE, NOISES[1][0])),
    )
