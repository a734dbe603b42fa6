"""Your own paths of the fan, a chirp and sudden steps, and the admittance controller behind them.

Install:  pip install .    (in a checkout)
Run:      python examples/fan_path.py
"""

from pathlib import Path

import numpy as np

from windwrench.controllers import make_controller
from windwrench.envs import FanTrackingEnv
from windwrench.evaluation.episodes import fly_episode
from windwrench.runtime.drawing import BLACK, SERIES, new_figure, styled
from windwrench.runtime.page_files import write_png


def chirp(t):
    """Return y (n,) m at times (n,) s: 0.4 m at 0.02 Hz, rising to 0.12 Hz within 20 s."""
    return 0.4 * np.sin(2 * np.pi * (0.02 + 0.0025 * t) * t)


def steps(t):
    """Return a fan that jumps by 0.35 m every 4 s, to one side and back."""
    return 0.35 * (np.floor(t / 4.0) % 2)


PATHS = {"chirp": chirp, "steps": steps}


@styled()
def main(out="results/fan_path", controller="admittance", seed=4):
    """Fly each path, save ``fan_path.png`` in the folder ``out``, print and return the RMSE of the
    offset in m by path.
    """
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    figure = new_figure(5.0)
    axes = figure.subplots(len(PATHS), 1, sharex=True)
    rmse = {}
    for ax, (name, path) in zip(axes, PATHS.items(), strict=True):
        flown = fly_episode(
            FanTrackingEnv("base", fan_path=path), make_controller(controller), seed
        )
        rmse[name] = flown.rmse
        ax.plot(flown.time, flown.fan_y, "--", color=BLACK, label="fan")
        ax.plot(flown.time, flown.y, color=SERIES[1], label=f"vehicle, {controller}")
        ax.set(
            title=f"{name}: {flown.rmse:.2f} m RMSE" + (", lost" if flown.lost else ""),
            ylabel="y (m)",
        )
        print(f"{name}: {flown.rmse:.3f} m off the axis (RMSE){', lost' if flown.lost else ''}")
    axes[0].legend()
    axes[-1].set_xlabel("time (s)")
    write_png(figure, folder / "fan_path.png")
    print(folder / "fan_path.png")
    return rmse


if __name__ == "__main__":
    main()
