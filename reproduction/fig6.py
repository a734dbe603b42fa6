"""Fig. 6 of McKinnon and Schoellig (2016): the map of a fan's jet, felt by a hovering quadrotor.

The vehicle faces the fan and hovers 5 s at each point of a 0.5 m grid in the plane of the fan's
axis; the filter's force and torque, averaged over each hover, are the map. A finer line across the
jet at 2.3 m shows the profile that the tracking of Fig. 7 rests on. Unlike a real flight this one
also knows the truth.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from ..dynamics.vehicle_file import load_vehicle
from ..envs.closed_loop import ClosedLoop
from ..envs.fan import Fan
from ..envs.plant import NOISE, TICK
from ..runtime.drawing import BLACK, ESTIMATE, SERIES, TRUTH, new_figure, room_above, styled
from ..runtime.errors import InputError
from .calm_jet import calm_jet, strongest_torque
from .result import Columns, Progress, Result, compared, table

TITLE = "The force and torque map of a fan's jet (Fig. 6)"
SEEDS = 8

GRID_X, GRID_Y = np.linspace(1.0, 4.0, 7), np.linspace(-1.5, 1.5, 7)  # m
PROFILE_X, PROFILE_Y = 2.3, np.linspace(-1.5, 1.5, 31)  # m
HOVER = 5.0  # s, averaged at each point
TRANSIT = 1.0  # s, from one point to the next
SETTLE = 3.0  # s, between arrival and averaging
JET_FORCE = 0.05  # N; the jet is where its mean force is larger
RADII = (0.35, 0.45, 0.55)  # m, of fans: the chosen one, and to either side of it

Array = NDArray[np.float64]


class Hovers(NamedTuple):
    """The hovers of one flight, in order, or of several (seeds, ...); wrenches are force (N) and
    torque (Nm) in the world frame.
    """

    points: Array  # (n, 2) m, where they should be
    position: Array  # (n, 3) m, where they were, true mean
    estimate: Array  # (n, 6) mean over the hover
    # (n, 6) likewise: the jet with its gusts on the moving vehicle, and the unmodelled disturbance
    truth: Array
    jet: Array  # (n, 6) the jet's part of the truth
    spread: Array  # (n, 6) standard deviation of the estimate within the hover
    traces: Array  # (n, 2, 2, ticks) estimate and truth, of f_x and tau_z


def fly_points(points: Array, seed: int) -> Hovers:
    """Hover at ``points`` (n, 2) m in the plane of the fan's axis, one after the other in a single
    flight.

    Raises:
        InputError: a point farther than 2 m from the last.
    """
    legs = np.diff(points, axis=0, prepend=points[:1])
    if float(np.max(np.linalg.norm(legs, axis=1))) > 2.0:
        raise InputError("fig6: points must lie within 2 m of one another")
    fan = Fan()
    loop = ClosedLoop(load_vehicle("ardrone2"), fan=fan)
    rng = np.random.default_rng([6, seed])
    loop.reset(rng, np.array([*points[0], fan.height]), math.pi)
    ticks, n = round(HOVER / TICK), len(points)
    felt = loop.record[0]["plant"]["jet"]
    kept = np.empty((n, ticks, 21))
    for k in range(n):
        # a set point that moves, not one that jumps: a jump of 0.5 m would tilt the vehicle by 11
        # degrees
        loop.setpoint[3:5] = legs[k] / TRANSIT
        loop.run(rng.standard_normal((round(TRANSIT / TICK), NOISE)))
        loop.setpoint[3:6] = 0.0
        loop.setpoint[:2] = points[k]
        loop.run(rng.standard_normal((round(SETTLE / TICK), NOISE)))
        for i in range(ticks):
            loop.run(rng.standard_normal((1, NOISE)))
            kept[k, i, :3], kept[k, i, 3:6] = loop.state[16:19], loop.state[13:16]
            kept[k, i, 6:] = *loop.external, *felt, *loop.position
    traces = np.stack([kept[:, :, [0, 6]], kept[:, :, [5, 11]]], axis=1).transpose(0, 1, 3, 2)
    estimate, truth, jet, position = np.split(kept.mean(axis=1), [6, 12, 18], axis=1)
    return Hovers(points, position, estimate, truth, jet, kept[:, :, :6].std(axis=1), traces)


def grid_points() -> Array:
    """Return the map's points (49, 2) in the order of flight: back and forth along y, away from the
    fan.
    """
    rows = [
        np.stack([np.full(len(GRID_Y), x), GRID_Y[:: 1 if i % 2 == 0 else -1]], axis=1)
        for i, x in enumerate(GRID_X)
    ]
    return np.concatenate(rows)


def as_map(points: Array, values: Array) -> Array:
    """Return values (..., n) in the order of flight as maps (..., x, y)."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    return values[..., order].reshape(*values.shape[:-1], len(GRID_X), len(GRID_Y))


def odd_share(values: Array) -> float:
    """Return which share of a map's (..., y) power, with y about 0, changes its sign with y: 1 is
    antisymmetric.
    """
    odd, even = values - values[..., ::-1], values + values[..., ::-1]
    return float(np.sum(odd**2) / (np.sum(odd**2) + np.sum(even**2)))


def peak(y: Array, torque: Array) -> tuple[float, float]:
    """Return offset (m) and size (Nm) of the largest torque of a profile, by a parabola through its
    antisymmetric part.

    The top is flat, and noise would pick any of its points: the parabola takes all within 0.2 m of
    the largest.
    """
    half = y > 1e-9
    offset, odd = y[half], 0.5 * (torque - torque[::-1])[half]
    near = np.abs(offset - offset[np.argmax(odd)]) < 0.21
    a, b, c = np.polyfit(offset[near], odd[near], 2)
    return float(-b / (2 * a)), float(c - b * b / (4 * a))


def _correlation(a: Array, b: Array) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def _rms(a: Array) -> float:
    return float(np.sqrt(np.mean(a**2)))


def run(seeds: int, progress: Progress) -> Result:
    """Fly the map and the profile ``seeds`` times.

    Raises:
        InputError: fewer than one seed.
    """
    if seeds < 1:
        raise InputError(f"fig6: needs at least one seed, got {seeds}")
    fan, vehicle = Fan(), load_vehicle("ardrone2")
    points, line = grid_points(), np.stack([np.full(len(PROFILE_Y), PROFILE_X), PROFILE_Y], axis=1)
    flown: tuple[list[Hovers], list[Hovers]] = ([], [])
    for seed in range(seeds):
        flown[0].append(fly_points(points, seed))
        progress((seed + 0.6) / seeds)
        flown[1].append(fly_points(line, 1000 + seed))
        progress((seed + 1.0) / seeds)
    maps, profiles = (Hovers(*map(np.array, zip(*some, strict=True))) for some in flown)
    calm_map, calm_line = calm_jet(fan, vehicle, *points.T), calm_jet(fan, vehicle, *line.T)
    # which points count as jet is the fan's matter and must not depend on the noise of a flight
    inside = np.linalg.norm(calm_map[:, :3], axis=1) > JET_FORCE
    estimate, truth, traces = (x[:, inside] for x in (maps.estimate, maps.truth, maps.traces))
    middle = int(np.argmin(np.abs(PROFILE_Y)))
    at, size = peak(PROFILE_Y, profiles.estimate[:, :, 5].mean(axis=0))
    calm_size, calm_at = strongest_torque(fan, vehicle, PROFILE_X)
    peaks = {r: strongest_torque(Fan(radius=r), vehicle, PROFILE_X)[1] for r in RADII}
    felt_map, true_map = (as_map(points, np.moveaxis(x, 2, 1)) for x in (maps.estimate, maps.truth))
    mean_map = felt_map.mean(axis=0)
    figures: dict[str, Any] = {"seeds": seeds, "points_in_jet": int(inside.sum())}
    for trace, (axis, name, unit) in enumerate(((0, "force_x", "N"), (5, "torque_z", "Nm"))):
        felt, true = estimate[..., axis], truth[..., axis]
        shown, really = traces[:, :, trace, 0], traces[:, :, trace, 1]
        figures |= {
            f"correlation_{name}": _correlation(felt, true),
            f"correlation_{name}_with_jet_alone": _correlation(felt, maps.jet[:, inside, axis]),
            f"correlation_{name}_200hz": _correlation(shown, really),
            f"error_rms_{name}_{unit}": _rms(felt - true),
            f"error_rms_{name}_to_mean_jet_{unit}": _rms(felt - calm_map[inside, axis]),
        }
    figures |= {
        "torque_z_antisymmetry": odd_share(mean_map[5]),
        "force_x_symmetry": 1.0 - odd_share(mean_map[0]),
        "profile_torque_peak_offset_m": at,
        "profile_torque_peak_Nm": size,
        "true_jet_torque_peak_offset_m": calm_at,
        "true_jet_torque_peak_Nm": calm_size,
        "true_jet_torque_peak_offset_m_by_fan_radius": {f"{r:g}": at for r, at in peaks.items()},
        "map_largest_torque_Nm": float(np.abs(mean_map[5]).max()),
        "profile_force_x_on_axis_N": float(profiles.estimate[:, middle, 0].mean()),
        "true_force_x_on_axis_N": float(profiles.truth[:, middle, 0].mean()),
        "hover_offset_rms_m": _rms(np.linalg.norm(maps.position[..., :2] - maps.points, axis=2)),
    }
    cells = as_map(points, inside.astype(np.float64)) > 0
    correlations = figures["correlation_force_x"], figures["correlation_torque_z"]
    picture = draw(felt_map, true_map, profiles, calm_line, cells, correlations)
    comparison, remarks = compared(
        "fig6", globals(), f=figures, radius=fan.radius, peaks=peaks, points=len(points)
    )
    return Result(figures, _columns(*flown, calm_map, calm_line), picture, comparison, remarks)


def _columns(
    maps: list[Hovers], profiles: list[Hovers], calm_map: Array, calm_line: Array
) -> Columns:
    """Return one row for each hover."""
    blocks = []
    for kind, flights, calm in (("map", maps, calm_map), ("profile", profiles, calm_line)):
        for seed, h in enumerate(flights):
            block: dict[str, Any] = {"flight": kind, "seed": seed}
            block |= dict(zip("xy", h.points.T, strict=True))
            block |= dict(zip(("px", "py", "pz"), h.position.T, strict=True))
            for i, name in enumerate(("fx", "fy", "fz", "tx", "ty", "tz")):
                block[f"{name}_estimate"] = h.estimate[:, i]
                block[f"{name}_spread"] = h.spread[:, i]
                block[f"{name}_true"] = h.truth[:, i]
                block[f"{name}_jet"] = h.jet[:, i]
                block[f"{name}_mean_jet"] = calm[:, i]
            blocks.append(block)
    return table(blocks)


@styled()
def draw(
    estimate: Array,
    truth: Array,
    profiles: Hovers,
    calm: Array,
    inside: NDArray[np.bool_],
    correlations: tuple[float, float],
) -> Figure:
    """Draw the maps (seeds, 6, n, m), N and Nm, estimated and true, and the profiles beside the
    mean jet's (k, 6); ``inside`` (n, m) count as jet, where the ``correlations`` of f_x and tau_z
    are.
    """
    figure = new_figure(8.0)
    grid = figure.subplots(3, 3, height_ratios=[1, 1, 1.05])
    means = estimate.mean(axis=0), truth.mean(axis=0)
    error = np.sqrt(np.mean((estimate - truth) ** 2, axis=0))
    for row, axis, factor, unit, name in (
        (0, 0, 1.0, "N", "force $f_x$"),
        (1, 5, 1e3, "mNm", r"torque $\tau_z$"),
    ):
        limit = 1.05 * factor * max(float(np.abs(values[axis]).max()) for values in means)
        for axes, wrench, kind in zip(grid[row], means, ("estimated", "true"), strict=False):
            axes.set_title(f"{name} ({unit}), {kind}")
            colours = {"cmap": "viridis" if row == 0 else "RdBu_r", "vmax": limit}
            colours["vmin"] = 0.0 if row == 0 else -limit
            _heat(axes, factor * wrench[axis], inside, **colours)
            if row == 0:
                arrows = {"angles": "xy", "scale": 2.2, "width": 0.008, "pivot": "tail"}
                axes.quiver(GRID_X, GRID_Y, wrench[0].T, wrench[1].T, color="white", **arrows)
        axes, largest = grid[row, 2], 1.5e3 * float(error[axis].max())
        axes.set_title(f"RMS error, {name.split()[1]} (m{unit.removeprefix('m')})")
        _heat(axes, 1e3 * error[axis], inside, cmap="Oranges", vmin=0.0, vmax=largest)
        across = profiles.estimate, profiles.truth, calm
        lines = [factor * flown[..., axis] for flown in across]
        _profile(grid[2, row], f"{name.split()[1]} ({unit})", *lines)
    _agreement(grid[2, 2], estimate, truth, inside, correlations)
    figure.suptitle(
        f"A fan's jet felt by a hovering quadrotor: 5 s a point, mean of {len(estimate)} flights.\n"
        "Outlined: where the jet is (mean force above 0.05 N)"
    )
    return figure


def _heat(axes: Any, values: Array, inside: NDArray[np.bool_], **colours: Any) -> None:
    """Draw a map (n, m), a cell a point; outline the jet's cells."""
    mesh = axes.pcolormesh(GRID_X, GRID_Y, values.T, shading="nearest", **colours)
    axes.figure.colorbar(mesh, ax=axes, shrink=0.8)
    size = GRID_X[1] - GRID_X[0], GRID_Y[1] - GRID_Y[0]
    for i, j in np.argwhere(inside):
        corner = (GRID_X[i] - size[0] / 2, GRID_Y[j] - size[1] / 2)
        axes.add_patch(Rectangle(corner, *size, fill=False, ec="0.55", lw=0.6))
    axes.add_patch(Rectangle((0.0, -0.45), 0.22, 0.9, color="0.35"))
    arrow = {"arrowstyle": "->", "color": "0.35", "lw": 1.5}
    axes.annotate("", (0.68, 0.0), (0.28, 0.0), arrowprops=arrow)
    axes.text(0.0, -0.55, "fan", va="top")
    axes.set(xlim=(-0.1, 4.27), ylim=(-1.77, 1.77), aspect="equal")
    axes.set(xlabel="x (m), away from the fan", ylabel="y (m)")


def _profile(axes: Any, label: str, estimate: Array, truth: Array, calm: Array) -> None:
    """Draw a profile: mean and spread over the flights beside the truth."""
    y, mean, spread = PROFILE_Y, estimate.mean(axis=0), estimate.std(axis=0)
    band = {"color": ESTIMATE, "alpha": 0.2, "lw": 0}
    axes.fill_between(y, mean - spread, mean + spread, label="± std over flights", **band)
    axes.plot(y, calm, color=TRUTH, lw=3, label="mean jet")
    axes.plot(y, truth.mean(axis=0), "--", color=BLACK, lw=1.2, label="true")
    axes.plot(y, mean, "o-", color=ESTIMATE, ms=3.5, lw=1, label="estimated")
    axes.axhline(0, color="black", lw=0.5)
    axes.axvline(0, color="black", lw=0.5)
    room_above(axes, 0.5)
    axes.legend(loc="upper left")
    axes.set(title=f"across, at x = 2.3 m: {label}", xlabel="y (m)", ylabel=label)


def _agreement(
    axes: Any,
    estimate: Array,
    truth: Array,
    inside: NDArray[np.bool_],
    correlations: tuple[float, float],
) -> None:
    """Draw estimate against truth at the jet's points, each quantity as a share of its largest."""
    for axis, name, colour, correlation in zip(
        (0, 5), ("$f_x$", r"$\tau_z$"), SERIES, correlations, strict=False
    ):
        largest = float(np.abs(truth[:, axis]).max())
        x, y = (wrench[:, axis, inside].ravel() / largest for wrench in (truth, estimate))
        label = f"{name}, correlation {correlation:.3f}"
        axes.plot(x, y, ".", color=colour, ms=5, alpha=0.6, label=label)
    axes.plot([-1.1, 1.1], [-1.1, 1.1], color="black", lw=0.7)
    room_above(axes, 0.3)
    axes.legend(loc="upper left")
    axes.set_title("in the jet, shares of the largest")
    axes.set(xlabel="true", ylabel="estimated")
