"""Pictures, captions and films of the world, in a fresh process, because MuJoCo chooses its OpenGL
when it is imported.
"""

import ctypes.util
import os
import sys
from importlib.util import find_spec

import matplotlib.image
import numpy as np
import pytest

from tests.support.programs import said
from tests.support.vector_flights import TASKS
from windwrench.envs.scene_shapes import ESTIMATED, TRUE

pytestmark = pytest.mark.skipif(
    not any(map(ctypes.util.find_library, ("EGL", "OSMesa"))),
    reason="neither libEGL nor libOSMesa is installed: apt-get install libegl1 libgl1-mesa-dri",
)

# One process draws all, and is told neither of a display nor how to draw: what the tasks render, one
# of them in a film by Gymnasium's recorder; an episode of the command; and pictures of parts, in
# which Gymnasium's checker must not even warn.
DRAWN = """
import sys
import gymnasium as gym
from gymnasium.wrappers import RecordVideo
from windwrench.cli import main
from windwrench.envs import ACTIONS, OBSERVATIONS
from windwrench.runtime import page_files
for task, action, observation in zip(TASKS, ACTIONS, OBSERVATIONS):
    seen = {"action": action, "observation": observation, "width": 64, "height": 48}
    env = gym.make(f"windwrench/{task}-v2", render_mode="rgb_array", **seen)
    if FILMS and task == TASKS[0]:
        env = RecordVideo(env, "film")
    env.reset(seed=0)
    for _ in range(3):
        env.step(env.action_space.sample())
    print(env.render().shape)
    env.close()
page_files._DPI = 20
sys.argv = "windwrench fly --scenario static --gif --film-seconds 0.5 --out out --quiet".split()
try:
    main()
except SystemExit as ended:
    assert not ended.code
import warnings
import numpy as np
from gymnasium.utils.env_checker import check_env
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


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A folder with films, pictures, and what the program said."""
    folder = tmp_path_factory.mktemp("drawn")
    films = find_spec("moviepy") is not None
    code = DRAWN.replace("TASKS", repr(TASKS)).replace("FILMS", repr(films))
    environment = os.environ | dict.fromkeys(("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"), "")
    told = said(sys.executable, "-c", code, cwd=folder, env=environment)
    return folder, np.load(folder / "pictures.npz"), told


def changed(a, b):
    """Share of the pixels that differ visibly."""
    return np.mean(abs(a.astype(int) - b.astype(int)).max(axis=2) > 20)


def test_a_picture_has_the_size_asked_for_and_shows_the_vehicle_where_it_is_and_the_fan(drawn):
    _, pictures, _ = drawn
    assert (pictures["jet"].shape, pictures["jet"].dtype) == ((240, 320, 3), np.uint8)
    assert changed(pictures["still"], pictures["again"]) == 0.0
    for other in ("without vehicle", "without fan", "moved"):
        assert changed(pictures["still"], pictures[other]) > 0.005, other


def test_a_caption_has_a_colour_for_truth_and_estimate_time_and_error(drawn):
    _, pictures, _ = drawn
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
    last = drawn[2].splitlines()[-1]
    assert last.startswith("InputError")
    assert "no display" in last
    assert "MUJOCO_GL" in last


def test_an_episode_is_written_as_a_gif_that_keeps_the_colours_of_the_arrows(drawn):
    from PIL import Image

    out = drawn[0] / "out"
    assert {p.name for p in out.iterdir()} == {"fly.gif", "fly.png", "fly.scene.png", "run.json"}
    with Image.open(out / "fly.gif") as gif:
        assert (gif.n_frames, gif.info["duration"], gif.size) == (3, 160, (960, 540))
        gif.seek(2)
        last = np.array(gif.convert("RGB")) / 255.0
    for picture in (last, matplotlib.image.imread(out / "fly.scene.png")):
        red, green, blue = np.moveaxis(picture[..., :3], 2, 0)
        force = (red - green > 0.25) & (red - blue > 0.25)  # estimated
        assert np.count_nonzero(force) > 30


def test_every_task_is_rendered(drawn):
    """With four actions and observations: pictures are of the world alone."""
    assert drawn[2].splitlines()[:4] == ["(48, 64, 3)"] * 4


@pytest.mark.skipif(
    find_spec("moviepy") is None, reason="moviepy is not installed: pip install 'windwrench[video]'"
)
def test_gymnasium_s_recorder_films_an_episode(drawn):
    import imageio_ffmpeg

    (film,) = drawn[0].glob("film/*.mp4")
    assert imageio_ffmpeg.count_frames_and_secs(str(film))[0] == 4
