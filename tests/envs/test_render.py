"""Pictures, captions and films of the world; each in a fresh process, because MuJoCo chooses its
OpenGL when it is imported.
"""

import ctypes.util
import os
import subprocess
import sys
from importlib.util import find_spec

import matplotlib.image
import numpy as np
import pytest

from tests.support.vector_flights import TASKS
from windwrench.envs.scene_shapes import ESTIMATED, TRUE

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
import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env
import windwrench
from windwrench.envs import FanTrackingEnv, Scenario
from windwrench.envs.captions import captioned
still = Scenario("still", motions=("still",), offset=(0.3, 0.3))
env = FanTrackingEnv(still, "rgb_array", width=320, height=240)
env.reset(seed=0)
info = env.step(np.zeros(1, np.float32))[4]
pictures = {"jet": env.render()}
loop = env.loop
loop.record["fan"]["speed"] = 0.0  # the drops in the jet drift from picture to picture
pictures["still"], pictures["again"] = env.render(), env.render()
for name, flown in (
    ("captioned", info), ("later", info | {"time": 2.0}), ("farther", info | {"offset": 0.2})
):
    pictures[name] = captioned(env, "a film", [flown])
for body in ("vehicle", "fan"):
    geoms = loop.model.geom_bodyid == loop.model.body(body).id
    kept = loop.model.geom_rgba[geoms].copy(), loop.model.geom_matid[geoms].copy()
    loop.model.geom_rgba[geoms], loop.model.geom_matid[geoms] = 0.0, -1
    pictures["without " + body] = env.render()
    loop.model.geom_rgba[geoms], loop.model.geom_matid[geoms] = kept
loop.data.qpos[1] += 0.3
pictures["moved"] = env.render()
np.savez("pictures.npz", **pictures)
env.close()
warnings.simplefilter("error")
check_env(gym.make("windwrench/FanTracking-v2", render_mode="rgb_array").unwrapped)
import mujoco  # after the kit, which tells MuJoCo how to draw
def broken(*arguments):
    raise RuntimeError("no display")
mujoco.Renderer = broken
try:
    env.render()
except Exception as error:
    print(type(error).__name__, error)
"""


def run(folder, code, **changes):
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**os.environ, **changes},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Pictures, and the words of a machine that cannot draw."""
    folder = tmp_path_factory.mktemp("drawn")
    said = run(folder, DRAWN, MUJOCO_GL="", DISPLAY="", WAYLAND_DISPLAY="")
    return np.load(folder / "pictures.npz"), said


def changed(a, b):
    """Share of the pixels that differ visibly."""
    return np.mean(abs(a.astype(int) - b.astype(int)).max(axis=2) > 20)


def test_a_picture_has_the_size_asked_for_and_shows_the_vehicle_where_it_is_and_the_fan(drawn):
    pictures, _ = drawn
    assert (pictures["jet"].shape, pictures["jet"].dtype) == ((240, 320, 3), np.uint8)
    assert changed(pictures["still"], pictures["again"]) == 0.0
    for other in ("without vehicle", "without fan", "moved"):
        assert changed(pictures["still"], pictures[other]) > 0.005, other


def test_a_caption_has_a_colour_for_truth_and_estimate_time_and_error(drawn):
    pictures, _ = drawn
    first = pictures["captioned"]
    assert first.shape == (240, 320, 3)
    true, estimated = (
        np.count_nonzero(np.all(first == np.round(255 * mark[:3]), axis=2))
        for mark in (TRUE, ESTIMATED)
    )
    assert true > estimated > 10  # wide and narrow, as the arrows
    for other in ("later", "farther"):
        assert (first != pictures[other]).any()


def test_a_machine_that_cannot_draw_is_told_what_to_install(drawn):
    said = drawn[1]
    assert said.startswith("InputError")
    assert "no display" in said
    assert "MUJOCO_GL" in said


# a film by Gymnasium's recorder, what the other tasks render, and an episode of the command
FLOWN = """
import sys
import gymnasium as gym
from gymnasium.wrappers import RecordVideo
from windwrench.cli import main
from windwrench.envs import ACTIONS, OBSERVATIONS
from windwrench.runtime import page_files
page_files._DPI = 20
for task, action, observation in zip(TASKS, ACTIONS, OBSERVATIONS):
    seen = {"action": action, "observation": observation, "width": 64, "height": 48}
    env = gym.make(f"windwrench/{task}-v2", render_mode="rgb_array", **seen)
    if FILMS and task == TASKS[0]:
        env = RecordVideo(env, "film")
    env.reset(seed=0)
    for _ in range(3):
        env.step(env.action_space.sample())
    print(env.render().shape, env.metadata["render_fps"])
    env.close()
sys.argv = "windwrench fly --scenario static --gif --film-seconds 0.5 --out out".split()
main()
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A folder of films, and what the programs said."""
    folder = tmp_path_factory.mktemp("flown")
    films = find_spec("moviepy") is not None
    code = FLOWN.replace("TASKS", repr(TASKS)).replace("FILMS", repr(films))
    return folder, run(folder, code, MUJOCO_GL=BACKEND)


def test_an_episode_is_written_as_a_gif_that_keeps_the_colours_of_the_arrows(flown):
    from PIL import Image

    out = flown[0] / "out"
    assert {p.name for p in out.iterdir()} == {"fly.gif", "fly.png", "fly.scene.png", "run.json"}
    with Image.open(out / "fly.gif") as gif:
        assert (gif.n_frames, gif.info["duration"], gif.size) == (3, 160, (960, 540))
        gif.seek(2)
        last = np.array(gif.convert("RGB")) / 255.0
    for picture in (last, matplotlib.image.imread(out / "fly.scene.png")):
        red, green, blue = np.moveaxis(picture[..., :3], 2, 0)
        force = (red - green > 0.25) & (red - blue > 0.25)  # estimated
        assert np.count_nonzero(force) > 30


def test_every_task_is_rendered(flown):
    """With four actions and observations: pictures are of the world alone."""
    sizes = [line.rpartition(" ")[0] for line in flown[1].splitlines()]
    assert sizes[:4] == ["(48, 64, 3)"] * 4


@pytest.mark.skipif(
    find_spec("moviepy") is None, reason="moviepy is not installed: pip install 'windwrench[video]'"
)
def test_gymnasium_s_recorder_films_an_episode(flown):
    import imageio_ffmpeg

    (film,) = flown[0].glob("film/*.mp4")
    assert imageio_ffmpeg.count_frames_and_secs(str(film))[0] == 4
