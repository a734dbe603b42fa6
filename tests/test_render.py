"""Pictures and films of the world; each in a fresh process, because MuJoCo chooses its OpenGL when it is imported."""

import ctypes.util
import os
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

BACKEND = next((name for library, name in (("EGL", "egl"), ("OSMesa", "osmesa")) if ctypes.util.find_library(library)),
               None)

pytestmark = pytest.mark.skipif(BACKEND is None, reason="neither libEGL nor libOSMesa is installed")

PICTURES = """
import numpy as np
from windwrench.envs import FanTrackingEnv, Scenario
env = FanTrackingEnv(Scenario("still", motions=("still",), offset=(0.3, 0.3)), "rgb_array", width=320, height=240)
env.reset(seed=0)
env.step(np.zeros(1, np.float32))
pictures = {"jet": env.render()}
loop = env.loop
loop.record["fan"]["speed"] = 0.0  # the jet's tracers drift from picture to picture
pictures["still"], pictures["again"] = env.render(), env.render()
for body in ("vehicle", "fan"):
    geoms = loop.model.geom_bodyid == loop.model.body(body).id
    kept = loop.model.geom_rgba[geoms].copy(), loop.model.geom_matid[geoms].copy()
    loop.model.geom_rgba[geoms], loop.model.geom_matid[geoms] = 0.0, -1
    pictures["without " + body] = env.render()
    loop.model.geom_rgba[geoms], loop.model.geom_matid[geoms] = kept
loop.data.qpos[1] += 0.3
pictures["moved"] = env.render()
env.close()
np.savez("pictures.npz", **pictures)
"""


def run(folder, *command, **changes):
    environment = {**os.environ, "MUJOCO_GL": BACKEND, **changes}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    done = run(folder, sys.executable, "-c", PICTURES)
    assert done.returncode == 0, done.stderr
    return np.load(folder / "pictures.npz")


def changed(a, b):
    """Share of the pixels that differ visibly."""
    return np.mean(np.abs(a.astype(int) - b.astype(int)).max(axis=2) > 20)


def test_a_picture_has_the_size_asked_for_and_shows_something(pictures):
    picture = pictures["jet"]
    assert picture.shape == (240, 320, 3)
    assert picture.dtype == np.uint8
    assert picture.std() > 10


def test_a_picture_is_the_same_while_nothing_changes(pictures):
    assert changed(pictures["still"], pictures["again"]) == 0.0


@pytest.mark.parametrize("other", ["without vehicle", "without fan", "moved"])
def test_a_picture_shows_the_vehicle_where_it_is_and_the_fan(pictures, other):
    assert changed(pictures["still"], pictures[other]) > 0.005


def test_a_picture_shows_the_jet_in_blue(pictures):
    def blue(picture):
        red, _, blue = np.moveaxis(picture.astype(int), 2, 0)
        return np.count_nonzero(blue - red > 40)

    assert changed(pictures["jet"], pictures["still"]) > 0.005
    assert blue(pictures["jet"]) > 1.1 * blue(pictures["still"])


FILM = """
from pathlib import Path
import numpy as np
from windwrench.envs import FanTrackingEnv
from windwrench.envs.video import VideoWriter
env = FanTrackingEnv(render_mode="rgb_array", width=320, height=240)
env.reset(seed=0)
with VideoWriter(Path("film.mp4"), env) as writer:
    for _ in range(5):
        env.step(np.zeros(1, np.float32))
        writer.add()
try:
    with VideoWriter(Path("broken.mp4"), env) as writer:
        writer.add()
        raise KeyError("on the way")
except KeyError:
    print("broken off")
"""


@pytest.mark.skipif(find_spec("imageio_ffmpeg") is None, reason="the video extra is not installed")
def test_a_film_is_written_whole_or_not_at_all(tmp_path):
    import imageio_ffmpeg

    done = run(tmp_path, sys.executable, "-c", FILM)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "broken off"
    assert {p.name for p in tmp_path.iterdir()} == {"film.mp4", "film.scene.png"}
    assert (tmp_path / "film.scene.png").read_bytes().startswith(b"\x89PNG")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert frames == 5
    assert seconds == pytest.approx(0.4, abs=0.05)


def test_without_a_screen_it_draws_without_being_told_how(tmp_path):
    code = ("from windwrench.envs import FanTrackingEnv\n"
            "env = FanTrackingEnv(render_mode='rgb_array', width=320, height=240); env.reset(seed=0)\n"
            "print(env.render().shape)")
    done = run(tmp_path, sys.executable, "-c", code, MUJOCO_GL="", DISPLAY="", WAYLAND_DISPLAY="")
    assert done.stdout.strip() == "(240, 320, 3)", done.stderr


def test_a_machine_that_cannot_draw_is_told_what_to_install(tmp_path):
    code = ("import mujoco\n"
            "def broken(*arguments): raise RuntimeError('no display')\n"
            "mujoco.Renderer = broken\n"
            "from windwrench.envs import FanTrackingEnv\n"
            "env = FanTrackingEnv(render_mode='rgb_array'); env.reset(seed=0)\n"
            "try: env.render()\n"
            "except Exception as error: print(type(error).__name__, error)")
    done = run(tmp_path, sys.executable, "-c", code)
    assert done.stdout.startswith("InputError")
    assert "no display" in done.stdout
    assert "MUJOCO_GL" in done.stdout
