"""This machine's way to draw, settled before MuJoCo is imported, and its windows: without a display
MuJoCo's viewer ends the interpreter.
"""

import ctypes
import os
import sys
import warnings
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from ..runtime.errors import InputError

_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")
_LINUX = sys.platform.startswith("linux")


def _choose() -> None:
    """Choose how MuJoCo draws on a machine without a screen, unless the user has."""
    if not _LINUX or any(os.environ.get(name) for name in (*_VARIABLES, "MUJOCO_GL")):
        return
    for backend, library in (("egl", "libEGL.so.1"), ("osmesa", "libOSMesa.so.8")):
        with suppress(OSError):
            ctypes.CDLL(library)
            os.environ["MUJOCO_GL"] = backend
            return


_choose()
try:
    import mujoco  # noqa: F401
except Exception as error:
    asked = os.environ.get("MUJOCO_GL")
    if asked is None:
        raise
    raise InputError(
        f"MUJOCO_GL={asked}: MuJoCo cannot draw that way ({error}); expected egl, osmesa, glfw "
        f"or disable, or the variable not set"
    ) from error


def modes_shown(metadata: Mapping[str, Any]) -> list[str]:
    """Return the render modes of an environment's ``metadata`` on this machine: without a display's
    name no ``human``.
    """
    windows = not _LINUX or any(os.environ.get(v) for v in _VARIABLES)
    return [mode for mode in metadata["render_modes"] if mode != "human" or windows]


def need_display() -> None:
    """Check that a window can be opened.

    Raises:
        InputError: there is no display, or the library for windows does not find it.
    """
    if not _LINUX:
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
        f"render: no window without a display ({why}); expected render_mode='rgb_array' or "
        f"--gif on a machine without one"
    )
