"""Fig. 3, calibration: hover, 53 g under the centre, 53 g under the front pair of rotors.

Each flight's estimates of vertical force and pitch torque must gather about the known wrench of the
mass. A Gaussian mixture that is not told which flight an estimate comes from must find the three
wrenches. The same flights, with one source of noise left out or alone, say what the spread is made
of.
"""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..envs.plant import PlantSettings
from ..envs.suspended_load import SuspendedLoad
from ..runtime.errors import InputError
from .hanging_mass import CALM, CENTRE_LOAD, FORCE, ROTOR_LOAD, TORQUE, hover
from .result import Comparison, Progress, Result, remarks

TITLE = "Fig. 3: calibration with a known mass"
SEEDS = 2

Array = NDArray[np.float64]
LOADS: dict[str, SuspendedLoad | None] = {
    "hover": None,
    "53 g under the centre": CENTRE_LOAD,
    "53 g under the front rotors": ROTOR_LOAD,
}
TARGETS = np.array([[0.0, 0.0], [FORCE, 0.0], [FORCE, TORQUE]])  # (N, Nm)
# s that count of a flight: actuator noise shifts a flight's mean torque by 1.4 mNm (standard
# deviation) in 30 s and by 0.9 mNm in 90 s, so that one seed stays within the 3 mNm of the
# requirement
_COUNTED = 90.0
_HANG, _SETTLED = 1.0, 12.0  # s; the position integral takes 10 s to trim out the mass
# What the requirement allows of a cluster: mean off its target, and standard deviation, (N, Nm)
_MEAN_BOUND, _STD_BOUND = np.array([0.02, 0.003]), np.array([0.05, 0.02])
# sensor noise, 8-bit rotor speeds, actuator noise: is it there?
SOURCES = {
    "everything": (True, True, True),
    "sensor noise alone": (True, False, False),
    "8-bit rotor speeds alone": (False, True, False),
    "actuator noise alone": (False, False, True),
    "without sensor noise": (False, True, True),
    "without 8-bit rotor speeds": (True, False, True),
    "without actuator noise": (True, True, False),
}
_COLOURS = ("#6f6f6f", "#30638e", "#d1495b")


@dataclass(frozen=True)
class Cluster:
    """One component of the mixture, matched to the wrench that it should be."""

    mean: Array  # (2,) N, Nm
    covariance: Array  # (2, 2)
    own: float  # share of its own flights' estimates that it takes

    @property
    def std(self) -> Array:
        """Standard deviations (2,), N and Nm."""
        return np.sqrt(np.diag(self.covariance))


def run(seeds: int, progress: Progress, seconds: float = _COUNTED) -> Result:
    """Fly the three flights with every source of noise and with some; ``seconds`` s of each count,
    once it has settled.
    """
    vehicle = load_vehicle("ardrone2")
    estimates: dict[str, Array] = {}
    offset = np.zeros((len(TARGETS), 2))
    for i, (name, present) in enumerate(SOURCES.items()):
        estimates[name], unmodelled = fly_loads(vehicle, present, seeds, seconds)
        if name == "everything":
            offset = unmodelled
        progress((i + 1) / len(SOURCES))
    main = estimates["everything"]
    clusters = fit_clusters(main)
    spread = {name: _spread(flown) for name, flown in estimates.items()}
    labels = np.broadcast_to(np.array(list(LOADS))[:, None, None], main.shape[:3])
    data: dict[str, NDArray[np.generic]] = {
        "load": labels.ravel(),
        "seed": np.broadcast_to(np.arange(seeds)[None, :, None], main.shape[:3]).ravel(),
        "force_z_N": main[..., 0].ravel(),
        "torque_pitch_Nm": main[..., 1].ravel(),
    }
    figures = _figures(clusters, spread, offset)
    return Result(
        figures,
        data,
        _draw(main, clusters, spread),
        _compare(clusters),
        _remarks(clusters, spread, offset),
    )


def fly_loads(
    vehicle: Vehicle, present: tuple[bool, bool, bool], seeds: int, seconds: float
) -> tuple[Array, Array]:
    """Fly the three loads with the sources of noise that are ``present``.

    Returns:
        The estimates (3 loads, seeds, n, 2) in N and Nm, and what the actuator noise really added
            to the wrench in the
        mean (3 loads, 2).
    """
    sensor, bits, actuator = present
    settings = replace(PlantSettings() if actuator else CALM, sensor_noise=sensor)
    flier = vehicle if bits else replace(vehicle, omega_lsb=0.0)
    end = _SETTLED + seconds
    estimates, added = [], []
    # every load and every seed its own noise, the same with and without a source
    for i, load in enumerate(LOADS.values()):
        flights = [
            hover(flier, load, end, _HANG, 1000 * i + seed, settings=settings)
            for seed in range(seeds)
        ]
        counted = flights[0].between(_SETTLED, end)
        estimates.append(
            [np.stack([f.force[:, 2], f.torque[:, 1]], axis=1)[counted] for f in flights]
        )
        added.append(np.mean([f.actuator[counted][:, [2, 4]] for f in flights], axis=(0, 1)))
    return np.array(estimates), np.array(added)


def fit_clusters(estimates: Array) -> list[Cluster]:
    """Fit a Gaussian mixture to estimates (3 loads, seeds, n, 2); return its components in the
    order of the targets.

    Raises:
        InputError: scikit-learn is not installed.
    """
    try:
        mixture: Any = importlib.import_module("sklearn.mixture")
    except ImportError as error:
        raise InputError(
            "fig3 fits a Gaussian mixture with scikit-learn, which is not installed: "
            "pip install 'windwrench[paper]'"
        ) from error
    # in units of the allowed spread: newtons and newton metres are not alike
    scaled = estimates.reshape(-1, 2) / _STD_BOUND
    model = mixture.GaussianMixture(len(TARGETS), n_init=5, random_state=0).fit(scaled)
    means, covariances = (
        model.means_ * _STD_BOUND,
        model.covariances_ * np.outer(_STD_BOUND, _STD_BOUND),
    )
    distance = np.linalg.norm((TARGETS[:, None] - means[None]) / _STD_BOUND, axis=2)
    _, match = linear_sum_assignment(distance)
    taken = model.predict(scaled).reshape(len(TARGETS), -1)
    return [
        Cluster(means[j], covariances[j], float(np.mean(taken[i] == j)))
        for i, j in enumerate(match)
    ]


def _spread(estimates: Array) -> Array:
    """Return the standard deviations (2,) about each load's mean, over the three loads."""
    std: Array = np.sqrt(estimates.reshape(len(TARGETS), -1, 2).var(axis=1).mean(axis=0))
    return std


def _figures(clusters: Sequence[Cluster], spread: dict[str, Array], added: Array) -> dict[str, Any]:
    rows = []
    for name, target, cluster, real in zip(LOADS, TARGETS, clusters, added, strict=True):
        error = np.abs(cluster.mean - target)
        rows.append(
            {
                "load": name,
                "target_N": float(target[0]),
                "target_Nm": float(target[1]),
                "mean_N": float(cluster.mean[0]),
                "mean_Nm": float(cluster.mean[1]),
                "std_N": float(cluster.std[0]),
                "std_Nm": float(cluster.std[1]),
                "actuator_mean_N": float(real[0]),
                "actuator_mean_Nm": float(real[1]),
                "own_estimates": cluster.own,
                "mean_within_one_std": bool(np.all(error < cluster.std)),
                "mean_within_bounds": bool(np.all(error < _MEAN_BOUND)),
                "std_within_bounds": bool(np.all(cluster.std < _STD_BOUND)),
            }
        )
    limits = [
        {"source": name, "std_N": float(std[0]), "std_Nm": float(std[1])}
        for name, std in spread.items()
    ]
    return {"clusters": rows, "limits": limits}


def _compare(clusters: Sequence[Cluster]) -> list[Comparison]:
    rows = []
    for name, target, cluster in zip(LOADS, TARGETS, clusters, strict=True):
        rows.append(
            Comparison(
                f"{name}: force z (N), pitch torque (Nm)",
                f"{target[0]:.2f}, {target[1]:.3f}",
                f"{cluster.mean[0]:+.3f}, {cluster.mean[1]:+.4f}",
            )
        )
    worst = np.max([cluster.std for cluster in clusters], axis=0)
    rows.append(
        Comparison(
            "largest standard deviation (N, Nm)",
            "0.05, 0.02 allowed",
            f"{worst[0]:.3f}, {worst[1]:.4f}",
        )
    )
    return rows


def _remarks(clusters: Sequence[Cluster], spread: dict[str, Array], added: Array) -> list[str]:
    off = np.array([cluster.mean for cluster in clusters]) - TARGETS
    plain, rest = np.abs(off).max(axis=0), np.abs(off - added).max(axis=0)
    alone = {
        name: 1e3 * spread[f"{name} alone"]
        for name in ("sensor noise", "8-bit rotor speeds", "actuator noise")
    }
    return remarks(
        "fig3",
        alone=alone,
        most=[max(alone, key=lambda name, axis=axis: float(alone[name][axis])) for axis in (0, 1)],  # type: ignore[misc]
        calm=1e3 * spread["without actuator noise"],
        plain=1e3 * plain,
        rest=1e3 * rest,
    )


def _draw(estimates: Array, clusters: Sequence[Cluster], spread: dict[str, Array]) -> Figure:
    figure = Figure(figsize=(13, 5.6), layout="constrained")
    plane, force, torque = figure.subplots(1, 3, width_ratios=[2.1, 1, 1])
    _draw_plane(plane, estimates, clusters)
    names = list(spread)
    for axis, (axes, label, scale, unit) in enumerate(
        ((force, "force z", 1e3, "mN"), (torque, "pitch torque", 1e3, "mNm"))
    ):
        values = [spread[name][axis] * scale for name in names]
        colours = ["#222222"] + [_COLOURS[1]] * 3 + ["#b8c9d9"] * 3
        axes.barh(range(len(names)), values, 0.62, color=colours)
        for y, value in enumerate(values):
            axes.annotate(
                f"{value:.{1 + axis}f} {unit}",
                (value, y),
                (3, 0),
                textcoords="offset points",
                va="center",
                fontsize=9,
            )
        axes.set_yticks(range(len(names)), names if axis == 0 else [""] * len(names))
        axes.invert_yaxis()
        axes.margins(x=0.4)
        axes.set_xlabel(f"std of {label} ({unit})")
        axes.spines[["top", "right"]].set_visible(False)
    force.set_title("what the spread is made of", loc="left", fontsize=10)
    return figure


def _draw_plane(axes: Any, estimates: Array, clusters: Sequence[Cluster]) -> None:
    """Draw estimates, the mixture's ellipses and the targets in the plane of force (N) and torque
    (mNm).
    """
    thin = max(1, estimates[0].size // 2 // 1000)
    for i, (load, colour, cluster) in enumerate(zip(LOADS, _COLOURS, clusters, strict=True)):
        some, (x, y) = estimates[i].reshape(-1, 2)[::thin], TARGETS[i]
        axes.scatter(
            some[:, 0],
            some[:, 1] * 1e3,
            s=6,
            color=colour,
            alpha=0.35,
            lw=0,
            label="estimates" if i == 0 else None,
        )
        _ellipses(axes, cluster, colour)
        axes.plot(
            x,
            y * 1e3,
            "+",
            color="black",
            ms=17,
            mew=1.8,
            ls="none",
            zorder=6,
            label="target" if i == 0 else None,
        )
        axes.plot(
            cluster.mean[0],
            cluster.mean[1] * 1e3,
            "o",
            color="white",
            mec="black",
            ms=5,
            ls="none",
            zorder=7,
            label="mixture: mean, 1 and 2 standard deviations" if i == 0 else None,
        )
        text = (
            f"{cluster.mean[0]:+.3f} ± {cluster.std[0]:.3f} N\n"
            f"{cluster.mean[1] * 1e3:+.1f} ± {cluster.std[1] * 1e3:.1f} mNm"
        )
        # above its cloud
        axes.annotate(
            load,
            (x, (y + 4.2 * cluster.std[1]) * 1e3),
            (0, 26),
            textcoords="offset points",
            ha="center",
            fontsize=10,
            color=colour,
            weight="bold",
        )
        axes.annotate(text, (x, (y + 4.2 * cluster.std[1]) * 1e3), ha="center", fontsize=9)
    axes.margins(x=0.16)
    low, top = axes.get_ylim()[0], (TARGETS[2, 1] + 4.2 * clusters[2].std[1]) * 1e3
    axes.set_ylim(low, top + 0.16 * (top - low))  # room for the topmost name
    axes.axhline(0.0, color="#cccccc", lw=0.8, zorder=0)
    axes.set_xlabel("estimated force along z (N)")
    axes.set_ylabel("estimated pitch torque (mNm)")
    axes.set_title("53 g on a thread: the estimates of three flights", loc="left", fontsize=10)
    axes.legend(loc="upper right", frameon=False, fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)


def _ellipses(axes: Any, cluster: Cluster, colour: str) -> None:
    """Draw the lines of one and two standard deviations, torque in mNm."""
    scale = np.diag([1.0, 1e3])
    moments, directions = np.linalg.eigh(scale @ cluster.covariance @ scale)
    angle = np.degrees(np.arctan2(directions[1, 1], directions[0, 1]))
    for sigmas in (1, 2):
        axes.add_patch(
            Ellipse(
                (cluster.mean[0], cluster.mean[1] * 1e3),
                2 * sigmas * np.sqrt(moments[1]),
                2 * sigmas * np.sqrt(moments[0]),
                angle=angle,
                fill=False,
                ec=colour,
                lw=1.6,
                zorder=5,
            )
        )
