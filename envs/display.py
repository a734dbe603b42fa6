"""Whether this machine can show a window: MuJoCo's viewer ends the interpreter where it cannot."""

import os
import sys
import warnings
from collections.abc import Mapping
from typing import Any

from ..runtime.errors import InputError

_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")


def modes_shown(metadata: Mapping[str, Any]) -> list[str]:
    """Return those of the render modes of an environment's ``metadata`` that this machine can show:
    no ``human`` where nothing names a display.
    """
    windows = not sys.platform.startswith("linux") or any(os.environ.get(v) for v in _VARIABLES)
    return [mode for mode in metadata["render_modes"] if mode != "human" or windows]


def need_display() -> None:
    """Check that a window can be opened.

    Raises:
        InputError: there is no display, or the library for windows does not find it.
    """
    if not sys.platform.startswith("linux"):
        return  # elsewhere there is a display, and windows belong to the main thread
    named = [f"{name}={os.environ[name]}" for name in _VARIABLES if os.environ.get(name)]
    why = "DISPLAY and WAYLAND_DISPLAY are not set"
    if named:
        try:
            import glfw
        except ImportError as error:
            why = str(error)
        else:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # its errors come as warnings, too
                if glfw.init():
                    return
            why = f"GLFW finds none at {', '.join(named)}"
    raise InputError(
        f"render: no window without a display ({why}); expected render_mode='rgb_array', --gif or "
        f"--video on a machine without one"
    )
