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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..envs.plant import PlantSettings
from ..runtime.drawing import SERIES, TRUTH, new_figure, only_ticks, styled
from .hanging_mass import CALM, ROTOR_LOAD, THREAD, hover
from .result import Progress, Result, compared, table

TITLE = "Fig. 4: step response to a known mass"
SEEDS = 6

Array = NDArray[np.float64]
HANG = 7.0  # s
_END = 20.0  # s
_EVERY = 2  # ticks
TRANSIENT = 5.0  # s after the mass is hung on, in which the lateral force is watched
NOISES = ((0.001, 0.005), (0.01, 0.05))  # m, rad: motion capture, and a vision system
SWEEP = (0.25, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)  # s, tuned rise times
_SHOWN = (0.5, 1.0, 2.0)  # s, drawn over time and held against the requirement
RISE, RISE_BOUND, LATERAL_BOUND = 1.0, 0.2, 0.1  # s, s, N
_SPAN = (5.5, 14.0)  # s, drawn


@dataclass(frozen=True)
class Step:
    """The response at one tuning and one noise level, over all seeds."""

    noise: tuple[float, float]  # m, rad
    actuator: bool  # with the unmodelled actuator noise
    tuned: float  # s, rise time
    time: Array  # (n,) s
    # (n, 3) mean of the flights: force along z (N), torque about the pitch axis (Nm), and size of
    # the lateral force of the mass (N)
    response: Array
    pull: Array  # (n, 3) likewise, the thread's true pull
    merits: dict[str, Any]  # the figures of merit, as JSON


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
    rows = [step.merits for step in steps]
    figures = {
        "rise_within_bounds": all(
            abs(row[name] - RISE) <= RISE_BOUND
            for row in rows
            if row["actuator_noise"] and row["tuned_rise_s"] == RISE
            for name in ("force_rise_s", "torque_rise_s")
        ),
        "lateral_within_bounds": all(row["lateral_N"] <= LATERAL_BOUND for row in rows),
        "sweep": rows,
    }
    data = table([_columns(step) for step in steps if step.actuator and step.tuned in _SHOWN])
    quiet = {
        row["position_noise_m"]: row
        for row in rows
        if not row["actuator_noise"] and row["tuned_rise_s"] == RISE
    }
    comparison, remarks = compared(
        "fig4",
        globals(),
        rows=rows,
        thread=THREAD,
        clean=quiet.get(NOISES[0][0]),
        noisy=quiet.get(NOISES[1][0]),
    )
    return Result(figures, data, draw(steps), comparison, remarks)


def _columns(step: Step) -> dict[str, Any]:
    return {
        "noise_m": step.noise[0],
        "noise_rad": step.noise[1],
        "tuned_rise_s": step.tuned,
        "t_s": step.time,
        "force_z_N": step.response[:, 0],
        "torque_pitch_Nm": step.response[:, 1],
        "force_lateral_N": step.response[:, 2],
        "true_force_z_N": step.pull[:, 0],
        "true_torque_pitch_Nm": step.pull[:, 1],
        "true_force_lateral_N": step.pull[:, 2],
    }


def fly_step(
    vehicle: Vehicle, noise: tuple[float, float], actuator: bool, tuned: float, seeds: int
) -> Step:
    """Fly the step and its pair without the mass with each seed."""
    settings = PlantSettings() if actuator else CALM
    seen = replace(vehicle.mocap, sigma_pos_m=noise[0], sigma_att_rad=noise[1])
    flier = replace(vehicle, mocap=seen)
    hung, left = (
        [hover(flier, load, _END, HANG, seed, tuned, settings, _EVERY) for seed in range(seeds)]
        for load in (ROTOR_LOAD, None)
    )
    time, pull = hung[0].time, np.mean([f.pull for f in hung], axis=0)
    loaded, bare = (np.array([f.wrench for f in flown]) for flown in (hung, left))
    response = loaded - bare  # (seeds, n, 6)
    mean = response.mean(axis=0)
    settled, transient = time >= 3.0, (time >= HANG) & (time < HANG + TRANSIENT)
    merits: dict[str, Any] = {
        "position_noise_m": noise[0],
        "attitude_noise_rad": noise[1],
        "actuator_noise": actuator,
        "tuned_rise_s": tuned,
    }
    for name, unit, axis in (("force", "N", 2), ("torque", "Nm", 4)):
        rise, error = _with_error(lambda x: rise_time(time, x), response[..., axis])
        merits |= {f"{name}_rise_s": rise, f"{name}_rise_error_s": error}
        # of a hover without the mass
        merits[f"{name}_std_{unit}"] = float(bare[:, settled, axis].std())
    lateral, lateral_error = _with_error(lambda x: float(_size(x)[transient].max()), response)
    made_up = mean[:, :2] - as_shown(time, mean[:, 2], pull[:, :2])
    merits |= {
        "lateral_N": lateral,
        "lateral_error_N": lateral_error,
        # of the mean of the flights with the mass, with the rest of their noise
        "unpaired_lateral_N": float(_size(loaded.mean(axis=0))[transient].max()),
        # beyond the thread's true pull as the filter would show it
        "made_up_lateral_N": float(_size(made_up)[transient].max()),
        "true_lateral_N": float(_size(pull)[time >= HANG].max()),
        "worst_flight_lateral_N": float(_size(loaded)[:, transient].max()),
        "worst_flight_lateral_without_mass_N": float(_size(bare)[:, transient].max()),
    }
    shown, true = (
        np.stack([wrench[:, 2], wrench[:, 4], _size(level)], axis=1)
        for wrench, level in ((loaded.mean(axis=0), mean), (pull, pull))
    )
    return Step(noise, actuator, tuned, time, shown, true, merits)


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


def _with_error(number: Callable[[Array], float], responses: Array) -> tuple[float, float | None]:
    """Return a number of the mean of responses (seeds, n, ...), and its standard error by the
    jackknife; None for one seed.
    """
    value, count = number(responses.mean(axis=0)), len(responses)
    if count == 1:
        return value, None
    left_out = [number(np.delete(responses, i, axis=0).mean(axis=0)) for i in range(count)]
    return value, float(np.sqrt((count - 1) * np.var(left_out)))


@styled()
def draw(steps: Sequence[Step]) -> Figure:
    """Draw force, torque and lateral force (rows) over time at each noise level, and the sweep's
    three curves beside.
    """
    figure = new_figure(7.0)
    grid = figure.subplots(3, 3, width_ratios=[1, 1, 1.05])
    for column, noise in enumerate(NOISES):
        shown = [step for step in steps if step.noise == noise and step.actuator]
        shown = [step for step in shown if step.tuned in _SHOWN]
        for row, axes in enumerate(grid[:, column]):
            axes.sharey(grid[row, 0])
            _draw_response(axes, row, shown)
        grid[0, column].set_title(f"pose noise {_words(noise)}")
    for row, name in enumerate(
        ("force z (N)", "pitch torque (mNm)", "lateral force of the mass (N)")
    ):
        grid[row, 0].set_ylabel(name)
    grid[2, 0].set_ylim(0, 1.2 * LATERAL_BOUND)
    _draw_choice(grid[:, 2], steps)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


def _words(noise: tuple[float, float]) -> str:
    return f"{noise[0] * 1e3:g} mm, {noise[1] * 1e3:g} mrad"


def _draw_response(axes: Any, row: int, shown: Sequence[Step]) -> None:
    """Draw force, torque or lateral force (by ``row``) of one noise level over time."""
    scale = 1e3 if row == 1 else 1.0
    # the truth of the middle tuning: the flights differ a little
    for step in shown[len(shown) // 2 :][:1]:
        pull = step.pull[:, row] * scale
        axes.plot(step.time, pull, color=TRUTH, lw=1, label="true pull of the thread")
    for step, colour in zip(shown, SERIES, strict=False):
        label = f"estimate, tuned to {step.tuned:g} s"
        axes.plot(step.time, step.response[:, row] * scale, color=colour, lw=1.8, label=label)
    axes.axvline(HANG, color="black", lw=0.6, ls=":")
    axes.set_xlim(*_SPAN)
    if row < 2:
        rises = [step.merits[("force_rise_s", "torque_rise_s")[row]] for step in shown]
        told = "rise times " + ", ".join(f"{rise:.2f}" for rise in rises) + " s"
        axes.text(0.97, (0.9, 0.06)[row], told, ha="right", transform=axes.transAxes)
        axes.tick_params(labelbottom=False)
        return
    axes.axhline(LATERAL_BOUND, color="black", lw=0.8, ls="--")
    axes.annotate("allowed", (_SPAN[0], LATERAL_BOUND), (3, 3), textcoords="offset points")
    axes.set_xlabel("time (s)")


def _draw_choice(column: Sequence[Any], steps: Sequence[Step]) -> None:
    """Draw standard deviation of force and torque, and the lateral transient, over
    the rise time.
    """
    panels = (
        (
            "force_rise_s",
            "rise time of the force, measured (s)",
            "force_std_N",
            "std of force z (mN)",
        ),
        (
            "torque_rise_s",
            "rise time of the torque, measured (s)",
            "torque_std_Nm",
            "std of pitch torque (mNm)",
        ),
        ("tuned_rise_s", "rise time tuned for (s)", "lateral_N", "peak lateral force (N)"),
    )
    for axes, (x, x_label, y, y_label) in zip(column, panels, strict=True):
        scale = 1.0 if y == "lateral_N" else 1e3
        for colour, noise in zip(SERIES[3:], NOISES, strict=False):
            for actuator, style in (
                (True, {"ls": "-", "lw": 1.6}),
                (False, {"ls": "--", "lw": 1.2, "mfc": "white"}),
            ):
                some = [
                    step.merits
                    for step in steps
                    if step.noise == noise and step.actuator == actuator
                ]
                label = _words(noise) + (", actuator noise" if actuator else ", rotors as told")
                values = [row[y] * scale for row in some]
                axes.plot(
                    [row[x] for row in some],
                    values,
                    marker="o",
                    ms=4,
                    color=colour,
                    label=label,
                    **style,
                )
        axes.set(xscale="log", xlabel=x_label, ylabel=y_label)
        only_ticks(axes.xaxis, (0.25, 0.5, 1.0, 2.0, 3.0))
    for axes, ticks in zip(column, ((2, 5, 10, 20, 50), (0.1, 0.3, 1, 3, 10)), strict=False):
        axes.set_yscale("log")
        only_ticks(axes.yaxis, ticks)
    column[0].set_title("noise against rise time")
    column[2].axhline(LATERAL_BOUND, color="black", lw=0.8, ls="--")
    column[2].set_ylim(0, 1.9 * LATERAL_BOUND)  # room for the names above the bound
    column[2].legend(loc="upper left")
