"""``python -m studies.winds`` writes the table and the picture of ``docs/winds.md``."""

import argparse
import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from windwrench.dynamics.motion import Array
from windwrench.envs.wind import (
    CompiledWind,
    FanWall,
    Gust,
    Shear,
    Turbulence,
    VehicleWash,
    low_altitude,
    spectrum,
    switching,
)
from windwrench.runtime.whole_files import replaced

_LINE = 0.25 * np.arange(512)  # m
_FIELDS = 500
_BANDS = ((0.2, 0.5), (0.5, 1.2), (1.2, 3.0), (3.0, 7.0))  # rad/m
_CASES = (
    ("Dryden, L = 4 m", "dryden", (np.full(3, 1.2), np.full(3, 4.0))),
    ("von Karman, L = 4 m", "von-karman", (np.full(3, 1.2), np.full(3, 4.0))),
    ("Dryden, 5 m high in 6 m/s", "dryden", low_altitude(5.0, 6.0)),
    ("von Karman, 5 m high in 6 m/s", "von-karman", low_altitude(5.0, 6.0)),
)
_BEGIN, _END = "<!-- spectra: begin -->\n", "<!-- spectra: end -->"


def measured(form: str, sigma: Array, length: Array) -> tuple[Array, Array]:
    """Return wave numbers (k,) rad/m and one-sided spectra (fields, k, 3) along the mean wind."""
    window = np.hanning(len(_LINE))[:, None]
    scale = _LINE[1] / (math.pi * float(np.sum(window**2)))
    points = np.column_stack([_LINE, 0.0 * _LINE, 0.0 * _LINE])
    power = [
        scale
        * np.abs(
            np.fft.rfft(
                window
                * Turbulence(seed, sigma, length, (5.0, 0.0, 0.0), form, smallest=0.1).velocity(
                    points, 0.0
                ),
                axis=0,
            )
        )
        ** 2
        for seed in range(_FIELDS)
    ]
    return 2.0 * math.pi * np.fft.rfftfreq(len(_LINE), _LINE[1]), np.array(power)


def table(spectra: list[tuple[Array, Array]]) -> str:
    """Return the ratios of measured and stated spectra, band by band."""
    head = " | ".join(f"{low:g}-{high:g} rad/m" for low, high in _BANDS)
    lines = [f"| turbulence | component | {head} |", "| - | - |" + " - |" * len(_BANDS)]
    for (name, form, (sigma, length)), (omega, power) in zip(_CASES, spectra, strict=True):
        for axis, what in enumerate(("along", "across", "up")):
            theory = spectrum(
                form, "along" if axis == 0 else "across", omega, sigma[axis], length[axis]
            )
            cells = []
            for low, high in _BANDS:
                band = (omega >= low) & (omega < high)
                each = power[:, band, axis].mean(axis=1) / theory[band].mean()
                cells.append(f"{each.mean():.2f} ({each.std() / math.sqrt(len(each)):.2f})")
            lines.append(f"| {name} | {what} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def draw(spectra: list[tuple[Array, Array]], path: Path) -> None:
    """Draw spectra, and slices through the other winds."""
    figure = Figure(figsize=(11, 6.6), layout="constrained")
    grid = figure.subplots(2, 3)
    for axes, k in ((grid[0, 0], 0), (grid[0, 1], 1)):
        name, form, (sigma, length) = _CASES[k]
        omega, power = spectra[k]
        for axis, what, colour in ((0, "along", "#30638e"), (1, "across", "#d1495b")):
            theory = spectrum(form, what, omega[1:], sigma[axis], length[axis])
            axes.loglog(omega[1:], power[:, 1:, axis].mean(axis=0), color=colour, lw=1, label=what)
            axes.loglog(omega[1:], theory, "--", color="black", lw=1)
        axes.set_title(f"{name}: {_FIELDS} fields, and theory", loc="left", fontsize=9)
        axes.set_xlabel("wave number (rad/m)")
        axes.set_ylabel("spectrum ((m/s)$^2$ m)")
        axes.legend(frameon=False, fontsize=8)
    wall = FanWall(switching(np.random.default_rng(2), 9, 20.0), turbulence=0.1)
    _slice(
        grid[0, 2], wall, "x", "y", (0.0, 5.0), (-1.6, 1.6), 1.2, 6.0, "a wall of fans, 6 s, 1.2 m"
    )
    mean = np.array([4.0, 0.0, 0.0])
    windy = Shear(mean, reference=1.5) + Turbulence(0, *low_altitude(3.0, 5.6), mean)
    _slice(
        grid[1, 0],
        windy,
        "x",
        "z",
        (0.0, 8.0),
        (0.05, 5.0),
        0.0,
        0.0,
        "shear and turbulence near the ground",
    )
    wash = VehicleWash((0.0, 0.0, 3.0))
    _slice(grid[1, 1], wash, "x", "z", (-1.5, 1.5), (0.2, 3.0), 0.0, 0.0, "the wash of a vehicle")
    t = np.linspace(0.0, 6.0, 600)
    for falls, label in ((True, "comes down"), (False, "stays")):
        gust = Gust((3.0, 0.0, 0.0), length=3.0, start=1.0, speed=3.0, falls=falls)
        speed = [gust.velocity([[2.0, 0.0, 1.0]], float(now))[0, 0] for now in t]
        grid[1, 2].plot(t, speed, label=label)
    grid[1, 2].set_title("a gust of 1 - cos passes a point", loc="left", fontsize=9)
    grid[1, 2].set_xlabel("time (s)")
    grid[1, 2].set_ylabel("wind (m/s)")
    grid[1, 2].legend(frameon=False, fontsize=8)
    for axes in (grid[0, 0], grid[0, 1], grid[1, 2]):
        axes.spines[["top", "right"]].set_visible(False)
    with replaced(path) as partial:
        figure.savefig(partial, dpi=100, format="png")


def _slice(
    axes: object,
    wind: CompiledWind,
    one: str,
    two: str,
    first: tuple[float, float],
    second: tuple[float, float],
    at: float,
    time: float,
    title: str,
) -> None:
    """Draw the speed of a wind on a plane."""
    a, b = np.linspace(*first, 160), np.linspace(*second, 120)
    columns = {"x": np.zeros(len(a) * len(b)), "y": np.zeros(len(a) * len(b))}
    columns["z"] = np.full(len(a) * len(b), at)
    A, B = np.meshgrid(a, b)
    columns[one], columns[two] = A.ravel(), B.ravel()
    speed = np.linalg.norm(wind.velocity(np.column_stack(list(columns.values())), time), axis=1)
    axes.set_title(title, loc="left", fontsize=9)  # type: ignore[attr-defined]
    drawn = axes.pcolormesh(a, b, speed.reshape(A.shape), cmap="Blues", shading="auto")  # type: ignore[attr-defined]
    axes.figure.colorbar(drawn, ax=axes, label="m/s")  # type: ignore[attr-defined]
    axes.set_xlabel(f"{one} (m)")  # type: ignore[attr-defined]
    axes.set_ylabel(f"{two} (m)")  # type: ignore[attr-defined]


def main() -> None:
    """Measure, draw, and write the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, default=Path("docs/winds.md"))
    parser.add_argument("--picture", type=Path, default=Path("docs/images/winds.png"))
    given = parser.parse_args()
    spectra = [measured(form, *sizes) for _, form, sizes in _CASES]
    text = table(spectra)
    print(text)
    draw(spectra, given.picture)
    page = given.page.read_text(encoding="utf-8")
    before, _, rest = page.partition(_BEGIN)
    with replaced(given.page) as partial:
        partial.write_text(
            before + _BEGIN + "\n" + text + "\n" + _END + rest.partition(_END)[2], encoding="utf-8"
        )


if __name__ == "__main__":
    main()
