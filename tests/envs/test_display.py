"""Windows on a machine without a display, in a process of their own: MuJoCo's viewer ends the
interpreter there.
"""

import os
import subprocess
import sys

import pytest

CODE = """
import os
import warnings
import gymnasium as gym
from gymnasium.utils.env_checker import check_env
import windwrench
from windwrench.envs.drawing import Viewer
from windwrench.runtime.errors import InputError
warnings.simplefilter("ignore")
for display in ("", ":4711"):
    os.environ["DISPLAY"] = display
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
def test_a_window_without_a_display_raises():
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        env={**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": ""},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = done.stdout.splitlines()
    # without a name of a display the checker does not ask for a window
    assert ["at :4711" in line or "DISPLAY=:4711" in line for line in lines] == 2 * [False] + (
        3 * [True]
    )
    assert all(line.startswith("render: no window without a display (") for line in lines)
