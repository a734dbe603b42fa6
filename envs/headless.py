"""Choosing how MuJoCo draws on a machine without a screen; imported before MuJoCo, which decides at
its own import.
"""

import ctypes
import os
import sys


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


_choose()
