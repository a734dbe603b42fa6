"""Pictures and films of the world; each in a fresh process, because MuJoCo chooses its OpenGL when
it is imported.
"""

import ctypes.util
import json
import os
import subprocess
import sys
from importlib.util import find_spec

import matplotlib.image
import numpy as np
import pytest

from windwrench.dynamics import InputError, load_vehicle
from windwrench.envs.replay import Flight
from windwrench.envs.rerun_export import write_rrd
from windwrench.envs.video import Film

BACKEND = next(
    (
        name
        for library, name in (("EGL", "egl"), ("OSMesa", "osmesa"))
        if ctypes.util.find_library(library)
    ),
    None,
)

pytestmark = pytest.mark.skipif(
    BACKEND is None,
    reason="neither libEGL nor libOSMesa is installed: apt-get install libegl1 libgl1-mesa-dri",
)

# One process draws all, and is told neither of a display nor how to draw. Gymnasium's checker must
# not even warn.
DRAWN = """
import warnings
from pathlib import Path
import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env
import windwrench
from windwrench.envs import FanTrackingEnv, Scenario
from windwrench.envs.video import Film
still = Scenario("still", motions=("still",), offset=(0.3, 0.3))
env = FanTrackingEnv(still, "rgb_array", width=320, height=240)
env.reset(seed=0)
env.step(np.zeros(1, np.float32))
pictures = {"jet": env.render()}
loop = env.loop
loop.record["fan"]["speed"] = 0.0  # the drops in the jet drift from picture to picture
pictures["still"], pictures["again"] = env.render(), env.render()
for body in ("vehicle", "fan"):
    geoms = loop.model.geom_bodyid == loop.model.body(body).id
    kept = loop.model.geom_rgba[geoms].copy(), loop.model.geom_matid[geoms].copy()
    loop.model.geom_rgba[geoms], loop.model.geom_matid[geoms] = 0.0, -1
    pictures["without " + body] = env.render()
    loop.model.geom_rgba[geoms], loop.model.geom_matid[geoms] = kept
loop.data.qpos[1] += 0.3
pictures["moved"] = env.render()
np.savez("pictures.npz", **pictures)
env.reset(seed=0)
for kind in KINDS:
    with Film(Path("film." + kind), 320, 240, longest=0.4) as film:
        for _ in range(7):
            env.step(np.zeros(1, np.float32))
            film.add(env.render())
    assert film.is_full
    try:
        with Film(Path("broken." + kind), 320, 240) as film:
            film.add(env.render())
            raise KeyError("on the way")
    except KeyError:
        pass
env.close()
warnings.simplefilter("error")
warnings.filterwarnings("ignore", ".*-v0 is out of date", DeprecationWarning)
check_env(gym.make("windwrench/FanTracking-v0", render_mode="rgb_array").unwrapped)
import mujoco  # after the kit, which tells MuJoCo how to draw
def broken(*arguments):
    raise RuntimeError("no display")
mujoco.Renderer = broken
try:
    env.render()
except Exception as error:
    print(type(error).__name__, error)
"""
KINDS = ["gif", *(["mp4"] if find_spec("imageio_ffmpeg") else [])]


def run(folder, code, **changes):
    environment = {**os.environ, **changes}
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Folder of pictures and films, and what a machine that cannot draw is told."""
    folder = tmp_path_factory.mktemp("drawn")
    no_screen = {"MUJOCO_GL": "", "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    done = run(folder, DRAWN.replace("KINDS", repr(KINDS)), **no_screen)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


@pytest.fixture(scope="module")
def pictures(drawn):
    return np.load(drawn[0] / "pictures.npz")


def changed(a, b):
    """Share of the pixels that differ visibly."""
    return np.mean(np.abs(a.astype(int) - b.astype(int)).max(axis=2) > 20)


def test_a_picture_has_the_size_asked_for_and_shows_the_vehicle_where_it_is_and_the_fan(pictures):
    assert (pictures["jet"].shape, pictures["jet"].dtype) == ((240, 320, 3), np.uint8)
    assert changed(pictures["still"], pictures["again"]) == 0.0
    for other in ("without vehicle", "without fan", "moved"):
        assert changed(pictures["still"], pictures[other]) > 0.005, other


def test_a_film_is_written_whole_or_not_at_all(drawn):
    folder, _ = drawn
    assert {p.name for p in folder.iterdir()} == {"pictures.npz", *(f"film.{k}" for k in KINDS)}


@pytest.mark.skipif(
    "mp4" not in KINDS,
    reason="imageio-ffmpeg is not installed: pip install 'windwrench[video]'",
)
def test_an_mp4_has_a_picture_a_decision(drawn):
    import imageio_ffmpeg

    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(drawn[0] / "film.mp4"))
    assert frames == 5
    assert seconds == pytest.approx(0.4, abs=0.05)


def test_a_gif_keeps_the_colours_of_the_arrows(drawn):
    from PIL import Image

    with Image.open(drawn[0] / "film.gif") as gif:
        assert gif.n_frames == 5
        assert gif.info["duration"] == 80
        assert gif.size == (320, 240)
        gif.seek(4)
        picture = np.array(gif.convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(picture, 2, 0)
    assert np.count_nonzero((red - green > 60) & (red - blue > 60)) > 3  # the estimated force


def test_a_machine_that_cannot_draw_is_told_what_to_install(drawn):
    said = drawn[1]
    assert said.startswith("InputError")
    assert "no display" in said
    assert "MUJOCO_GL" in said


def test_a_film_without_its_extra_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"windwrench\[video\]"):
        Film(tmp_path / "film.mp4", 320, 240)


COMMANDS = """
import contextlib, sys
from windwrench.cli import main
for line in LINES:
    sys.argv = ["windwrench", *line.split()]
    with contextlib.suppress(SystemExit):
        main()
"""
LINES = (
    "fly --scenario static --gif --film-seconds 0.2 --out out",
    "record --seconds 3 --trajectory circle --vehicle crazyflie --effect constant_force:fx=0.1 "
    "--out log.csv",
    "estimate log.csv --film --vehicle crazyflie --from 2 --film-seconds 0.5 --json --out again",
)


def test_commands_write_films_and_replays(tmp_path):
    def files(folder):
        return {p.name for p in (tmp_path / folder).iterdir()}

    done = run(tmp_path, COMMANDS.replace("LINES", repr(LINES)), MUJOCO_GL=BACKEND)
    assert files("out") == {"fly.gif", "fly.png", "fly.scene.png", "run.json"}, done.stderr
    again = {"film.gif", "film.png", "run.json", "tuning.yaml", "wrench.csv", "wrench.png"}
    assert files("again") == again
    told = next(line for line in done.stdout.splitlines() if '"force_mean_N"' in line)
    assert json.loads(told)["result"]["force_mean_N"][0] > 0.02
    picture = matplotlib.image.imread(tmp_path / "again" / "film.png")
    red, green, blue = np.moveaxis(picture[..., :3], 2, 0)
    assert np.count_nonzero((red - green > 0.25) & (red - blue > 0.25)) > 30  # path and force


def a_flight(count=20):
    t = 0.1 * np.arange(count)
    position = np.column_stack([np.sin(t), np.cos(t), 1.0 + 0.0 * t])
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    force = np.tile([0.2, 0.0, 0.0], (count, 1))
    return Flight(
        t,
        position,
        quaternion,
        force,
        0.01 * force[:, [2, 1, 0]],
        true_force=force,
        true_torque=force,
        fan_y=t,
    )


@pytest.mark.skipif(
    find_spec("rerun") is None, reason="rerun is not installed: pip install 'windwrench[rerun]'"
)
def test_a_rerun_recording_holds_the_flight(tmp_path):
    path = tmp_path / "flight.rrd"
    write_rrd(a_flight(), load_vehicle("ardrone2"), path)
    assert [p.name for p in tmp_path.iterdir()] == ["flight.rrd"]
    kept = path.read_bytes()
    assert kept.startswith(b"RRF")
    for entity in (
        b"/world/vehicle",
        b"/world/force/estimated",
        b"/world/force/true",
        b"/world/path",
        b"/world/fan",
        b"/force_x",
    ):
        assert entity in kept, entity


def test_a_rerun_recording_without_its_extra_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"windwrench\[rerun\]"):
        write_rrd(a_flight(), load_vehicle("ardrone2"), tmp_path / "flight.rrd")
    assert list(tmp_path.iterdir()) == []
