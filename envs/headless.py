"""Choosing how MuJoCo draws on a machine without a screen; imported before MuJoCo, which decides at
its own import.
"""

import ctypes
import os
import sys

from ..runtime.errors import InputError


def _choose() -> None:
    if not sys.platform.startswith("linux") or any(
        os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL")
    ):
        return
    for backend, library in (("egl", "libEGL.so.1"), ("osmesa", "libOSMesa.so.8")):
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        os.environ["MUJOCO_GL"] = backend
        return


def _import_mujoco() -> None:
    """Import MuJoCo, which refuses a way to draw that it does not know or cannot load.

    Raises:
        InputError: it does.
    """
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


_choose()
_import_mujoco()
