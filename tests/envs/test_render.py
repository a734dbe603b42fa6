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
from windwrench.envs.replay import Flight, arrow_scales
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
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


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


def test_a_picture_shows_the_vehicle_where_it_is_and_the_fan(pictures):
    assert changed(pictures["still"], pictures["again"]) == 0.0
    for other in ("without vehicle", "without fan", "moved"):
        assert changed(pictures["still"], pictures[other]) > 0.005, other


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
from windwrench.envs.video import Film
env = FanTrackingEnv(render_mode="rgb_array", width=320, height=240)
env.reset(seed=0)
with Film(Path("film.KIND"), 320, 240, longest=0.4) as film:
    for _ in range(7):
        env.step(np.zeros(1, np.float32))
        film.add(env.render())
assert film.is_full
try:
    with Film(Path("broken.KIND"), 320, 240) as film:
        film.add(env.render())
        raise KeyError("on the way")
except KeyError:
    print("broken off")
"""


def film(folder, kind):
    done = run(folder, sys.executable, "-c", FILM.replace("KIND", kind))
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "broken off"
    assert [p.name for p in folder.iterdir()] == [f"film.{kind}"]
    return folder / f"film.{kind}"


@pytest.mark.skipif(
    find_spec("imageio_ffmpeg") is None,
    reason="imageio-ffmpeg is not installed: pip install 'windwrench[video]'",
)
def test_a_film_is_written_whole_or_not_at_all(tmp_path):
    import imageio_ffmpeg

    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(film(tmp_path, "mp4")))
    assert frames == 5
    assert seconds == pytest.approx(0.4, abs=0.05)


def test_a_gif_keeps_the_colours_of_the_arrows(tmp_path):
    from PIL import Image

    with Image.open(film(tmp_path, "gif")) as gif:
        assert gif.n_frames == 5
        assert gif.info["duration"] == 80
        assert gif.size == (320, 240)
        gif.seek(4)
        picture = np.array(gif.convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(picture, 2, 0)
    assert np.count_nonzero((red - green > 60) & (red - blue > 60)) > 3  # the estimated force


def test_a_film_without_its_extra_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"windwrench\[video\]"):
        Film(tmp_path / "film.mp4", 320, 240)


def test_commands_write_films_and_replays(tmp_path):
    def windwrench(arguments):
        code = "from windwrench.cli import main; main()"
        return run(tmp_path, sys.executable, "-c", code, *arguments.split())

    def files(folder):
        return {p.name for p in (tmp_path / folder).iterdir()}

    done = windwrench("fly --scenario static --gif --film-seconds 0.2 --out out")
    assert done.returncode == 0, done.stderr
    assert files("out") == {"fly.gif", "fly.png", "fly.scene.png", "run.json"}
    done = windwrench(
        "record --seconds 3 --trajectory circle --vehicle crazyflie "
        "--effect constant_force:fx=0.1 --out log.csv"
    )
    assert done.returncode == 0, done.stderr
    done = windwrench(
        "estimate log.csv --film --vehicle crazyflie --from 2 --film-seconds 0.5 --json --out again"
    )
    assert done.returncode == 0, done.stderr
    assert files("again") == {"film.gif", "film.png", "run.json", "wrench.csv", "wrench.png"}
    assert json.loads(done.stdout)["result"]["force_mean_N"][0] > 0.02
    picture = matplotlib.image.imread(tmp_path / "again" / "film.png")
    red, green, blue = np.moveaxis(picture[..., :3], 2, 0)
    assert np.count_nonzero((red - green > 0.25) & (red - blue > 0.25)) > 30  # path and force
    done = windwrench("estimate log.csv --film --from 4 --out late")
    assert done.returncode == 2
    assert "--from 4" in done.stderr
    assert not (tmp_path / "late").exists()


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


def test_arrows_are_as_long_for_small_forces_as_for_large_ones():
    flight = a_flight()
    force, torque = arrow_scales(flight, 0.1262)
    assert 0.2 * force == pytest.approx(0.6)
    assert 0.002 * torque == pytest.approx(0.6)
    assert arrow_scales(flight, 0.0631)[0] == pytest.approx(force / 2)


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


def test_without_a_screen_it_draws_without_being_told_how(tmp_path):
    code = (
        "from windwrench.envs import FanTrackingEnv\n"
        "env = FanTrackingEnv(render_mode='rgb_array', width=320, height=240); env.reset(seed=0)\n"
        "print(env.render().shape)"
    )
    done = run(tmp_path, sys.executable, "-c", code, MUJOCO_GL="", DISPLAY="", WAYLAND_DISPLAY="")
    assert done.stdout.strip() == "(240, 320, 3)", done.stderr


def test_a_machine_that_cannot_draw_is_told_what_to_install(tmp_path):
    code = (
        "import mujoco\n"
        "def broken(*arguments): raise RuntimeError('no display')\n"
        "mujoco.Renderer = broken\n"
        "from windwrench.envs import FanTrackingEnv\n"
        "env = FanTrackingEnv(render_mode='rgb_array'); env.reset(seed=0)\n"
        "try: env.render()\n"
        "except Exception as error: print(type(error).__name__, error)"
    )
    done = run(tmp_path, sys.executable, "-c", code)
    assert done.stdout.startswith("InputError")
    assert "no display" in done.stdout
    assert "MUJOCO_GL" in done.stdout
