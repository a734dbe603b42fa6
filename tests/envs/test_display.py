"""Windows on a machine without a display, in a process of their own: MuJoCo's viewer ends the
interpreter there.
"""

import os
import subprocess
import sys

import pytest

CODE = """
import warnings
import gymnasium as gym
from gymnasium.utils.env_checker import check_env
import windwrench
from windwrench.envs.drawing import Viewer
from windwrench.runtime.errors import InputError
warnings.simplefilter("ignore")
env = gym.make("windwrench/FanTracking-v0")
for attempt in (
    lambda: gym.make("windwrench/FanTracking-v0", render_mode="human"),
    lambda: check_env(env.unwrapped),
    lambda: Viewer("human"),
):
    try:
        attempt()
    except InputError as error:
        print(error)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux's displays")
@pytest.mark.parametrize("display", [{}, {"DISPLAY": ":4711"}])
def test_a_window_without_a_display_raises(display):
    unset = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        env={**environment, **display},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = done.stdout.splitlines()
    # without a name of a display the checker does not ask for a window
    assert len(lines) == (3 if display else 2)
    assert all(line.startswith("render: no window without a display (") for line in lines)
