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
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..envs.plant import PlantSettings
from ..runtime.drawing import BLACK, GREY, PALE, SERIES, new_figure, styled
from ..runtime.errors import InputError
from .hanging_mass import CALM, CENTRE_LOAD, FORCE, ROTOR_LOAD, TORQUE, hover
from .result import Progress, Result, compared, table
from .suspended_load import SuspendedLoad

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
_LOAD_COLOURS = (GREY, *SERIES[:2])


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
    data = table(
        [
            {
                "load": load,
                "seed": seed,
                "force_z_N": main[i, seed, :, 0],
                "torque_pitch_Nm": main[i, seed, :, 1],
            }
            for i, load in enumerate(LOADS)
            for seed in range(seeds)
        ]
    )
    figures = _figures(clusters, spread, offset)
    off = np.array([cluster.mean for cluster in clusters]) - TARGETS
    alone = {
        name: 1e3 * spread[f"{name} alone"]
        for name in ("sensor noise", "8-bit rotor speeds", "actuator noise")
    }
    comparison, remarks = compared(
        "fig3",
        globals(),
        clusters=figures["clusters"],
        alone=alone,
        calm=1e3 * spread["without actuator noise"],
        plain=1e3 * np.abs(off).max(axis=0),
        rest=1e3 * np.abs(off - offset).max(axis=0),
    )
    return Result(figures, data, draw(main, clusters, spread), comparison, remarks)


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
        estimates.append([f.wrench[counted][:, [2, 4]] for f in flights])
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
            "pip install 'windwrench[reproduction]'"
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


@styled()
def draw(estimates: Array, clusters: Sequence[Cluster], spread: dict[str, Array]) -> Figure:
    """Draw the estimates (3 loads, seeds, n, 2) with the mixture, and the parts of the spread."""
    figure = new_figure(4.6)
    plane, *panels = figure.subplots(1, 3, width_ratios=[2.1, 1, 1])
    _draw_plane(plane, estimates, clusters)
    colours = [BLACK] + [SERIES[0]] * 3 + [PALE] * 3
    for i, (axes, label, unit) in enumerate(
        zip(panels, ("force z", "pitch torque"), ("mN", "mNm"), strict=True)
    ):
        values = [1e3 * std[i] for std in spread.values()]
        bars = axes.barh(list(spread), values, 0.62, color=colours)
        axes.bar_label(bars, fmt=f"%.{1 + i}f {unit}", padding=3)
        axes.invert_yaxis()
        axes.margins(x=0.4)
        axes.set_xlabel(f"std of {label} ({unit})")
    panels[0].set_title("what the spread is made of")
    panels[1].tick_params(labelleft=False)
    return figure


def _draw_plane(axes: Any, estimates: Array, clusters: Sequence[Cluster]) -> None:
    """Draw estimates, the mixture's ellipses and the targets in the plane of force (N) and torque
    (mNm).
    """
    scale, tops = np.array([1.0, 1e3]), []
    thin = max(1, estimates[0].size // 2 // 1000)
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    for i, (load, colour, cluster) in enumerate(zip(LOADS, _LOAD_COLOURS, clusters, strict=True)):
        some = estimates[i].reshape(-1, 2)[::thin] * scale
        label = None if i else "estimates"
        axes.scatter(*some.T, s=6, color=colour, alpha=0.35, lw=0, label=label)
        circle = np.linalg.cholesky(cluster.covariance) @ [np.cos(angle), np.sin(angle)]
        for sigmas in (1, 2):
            ellipse = (cluster.mean + sigmas * circle.T) * scale
            axes.plot(*ellipse.T, color=colour, lw=1.6, zorder=5)
        (force, torque), (std_force, std_torque) = cluster.mean * scale, cluster.std * scale
        text = f"{force:+.3f} ± {std_force:.3f} N\n{torque:+.1f} ± {std_torque:.1f} mNm"
        above = {"ha": "center", "textcoords": "offset points"}
        top = TARGETS[i] * scale + [0.0, 4.2 * std_torque]  # above its cloud
        axes.annotate(text, top, (0, 0), **above)
        axes.annotate(load, top, (0, 26), color=colour, weight="bold", **above)
        tops.append(top[1])
    axes.plot(*(TARGETS * scale).T, "k+", ms=17, mew=1.8, zorder=6, label="target")
    means = np.array([cluster.mean for cluster in clusters]) * scale
    label = "mixture: mean, 1 and 2 standard deviations"
    axes.plot(*means.T, "o", color="white", mec="black", ms=5, zorder=7, label=label)
    axes.margins(x=0.45)
    low = axes.get_ylim()[0]
    axes.set_ylim(low, tops[-1] + 0.16 * (tops[-1] - low))  # room for the topmost name
    axes.axhline(0.0, color=PALE, lw=0.8, zorder=0)
    axes.set(
        xlabel="estimated force along z (N)",
        ylabel="estimated pitch torque (mNm)",
        title="53 g on a thread: the estimates of three flights",
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15))
