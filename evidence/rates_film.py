"""A film of the learned Crazyflie in gusts, beside the flight loop alone in the same wind.

``python -m windwrench.evidence.rates_film POLICY.npz`` flies a policy of ``rates_learning`` in
WindHover's ``gusts``, in the first test episode of its seed. Grains drift with the air, the yellow
ball is the place to hold, and a line is the path of the last second.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from windwrench.envs.gif import write_gif
from windwrench.envs.scene_shapes import add_path, add_shape
from windwrench.evaluation.episodes import benchmark_seeds
from windwrench.evaluation.tasks import make_pilot, task_of
from windwrench.evidence.rates_learning import LAWED, LEARNED
from windwrench.evidence.runner import start

import mujoco  # isort: skip  # windwrench.envs settles before how it draws

Picture = NDArray[np.uint8]
SCENARIO, SEED = "gusts", 6900
_SIDE, _STRIP = 270, 110  # pixels, of a view and of the curves below
_BOX = 0.5  # m, half an edge of the cube of grains
_GRAINS = 60
_EVERY = 2  # decisions a picture
_INK, _LEARNED, _ALONE = (28, 36, 48), (190, 30, 30), (60, 110, 190)
_TOP = 0.4  # m, of the curves
_SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


class View:
    """One flight, seen from 0.9 m."""

    def __init__(self, controller: str, task: str) -> None:
        self.env = task_of(task).make(SCENARIO, render_mode="rgb_array").unwrapped
        self._pilot = make_pilot(controller, task)
        (seed,) = benchmark_seeds(SEED, 1)
        self._seen, self._info = self.env.reset(seed=seed)
        if hasattr(self._pilot, "brief"):
            self._pilot.brief(self.env.briefing())
        self._pilot.reset()
        self.errors, self.speed = [float(self._info["error"])], 0.0
        self._path = [self.env.loop.position.copy()]
        self._rng = np.random.default_rng(0)
        self._grains = np.full((_GRAINS, 3), np.inf)
        self._renderer: Any = None

    def step(self) -> None:
        """Fly a decision."""
        self._seen, _, _, _, self._info = self.env.step(self._pilot(self._seen, self._info))
        self.errors.append(float(self._info["error"]))
        self._path.append(self.env.loop.position.copy())
        self.speed = float(np.linalg.norm(self._info["wind"]))
        middle, loop, rng = self._info["reference"], self.env.loop, self._rng
        gone = np.abs(self._grains - middle).max(axis=1) > _BOX
        self._grains[gone] = middle + rng.uniform(-_BOX, _BOX, (int(gone.sum()), 3))
        self._grains += loop.winds.velocity(self._grains, max(loop.time, 0.0)) / 25.0

    def draw(self) -> Picture:
        """Return a picture (side, side, 3)."""
        loop, goal = self.env.loop, self._info["reference"]
        if self._renderer is None:
            self._renderer = mujoco.Renderer(loop.model, _SIDE, _SIDE)
        camera = mujoco.MjvCamera()
        camera.lookat[:], camera.distance = goal, 0.9
        camera.azimuth, camera.elevation = 150, -14
        loop.data.mocap_pos[0] = 0.0, 0.0, -50.0  # there is no fan
        mujoco.mj_kinematics(loop.model, loop.data)
        self._renderer.update_scene(loop.data, camera)
        scene = self._renderer.scene
        for grain in self._grains:
            add_shape(scene, _SPHERE, np.full(3, 0.004), grain, np.array([0.25, 0.55, 0.95, 0.5]))
        add_shape(scene, _SPHERE, np.full(3, 0.012), goal, np.array([0.95, 0.75, 0.1, 0.9]))
        add_path(scene, self._path[-25:])
        picture: Picture = self._renderer.render()
        return picture


def pictures(policy: str, seconds: float) -> Iterator[Picture]:
    """Yield the film's pictures (height, width, 3)."""
    views = View(policy, LEARNED), View("hover", LAWED)
    for k in range(round(25 * seconds)):
        for view in views:
            view.step()
        if k % _EVERY == 0:
            yield _page(views, seconds)


def _page(views: tuple[View, View], seconds: float) -> Picture:
    width, height = 2 * _SIDE, _SIDE + _STRIP
    page = Image.new("RGB", (width, height), (255, 255, 255))
    draw = ImageDraw.Draw(page)
    said = ("PPO, body rates", _LEARNED), ("flight loop alone", _ALONE)
    for i, (view, (name, colour)) in enumerate(zip(views, said, strict=True)):
        page.paste(Image.fromarray(view.draw()), (i * _SIDE, 0))
        draw.text((i * _SIDE + 8, 6), name, colour, font_size=16)
        told = f"{100 * view.errors[-1]:.0f} cm off"
        draw.text((i * _SIDE + 8, _SIDE - 24), told, colour, font_size=14)
        n = np.arange(len(view.errors))
        x = 8 + (width - 16) * n / (25 * seconds)
        y = height - 8 - (_STRIP - 32) * np.minimum(np.array(view.errors), _TOP) / _TOP
        draw.line([*zip(x.tolist(), y.tolist(), strict=True)], colour, 2)
    draw.line((8, height - 8, width - 8, height - 8), _INK, 1)
    told = f"distance from the ball, 0 to {100 * _TOP:.0f} cm, over {seconds:.0f} s"
    draw.text((8, _SIDE + 2), told, _INK, font_size=12)
    wind = f"wind {views[0].speed:.1f} m/s"
    draw.text((width - 8, _SIDE + 2), wind, _INK, font_size=12, anchor="ra")
    return np.asarray(page, dtype=np.uint8)


def film(policy: str, out: Path = Path("docs/images/rates.gif"), seconds: float = 8.0) -> None:
    """Write the film."""
    write_gif(list(pictures(policy, seconds)), 25 / _EVERY, out)


if __name__ == "__main__":
    start(film)
