"""The exported C filter, compiled here and driven from Python."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
STATUSES = ("tracking", "coasting", "rejected", "restarted")
PARTS = ("attitude", "angular_velocity", "position", "velocity", "torque", "force")
FLOATS = ctypes.POINTER(ctypes.c_float)


def needs(program):
    """Skip a test where a program is not installed."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    return program


def write(exported, folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in exported.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def run(*words, **options):
    """Run a program and return what it says; what it says of a failure is the failure's message."""
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{words[0]}: {done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout


def estimate_type(imu):
    names = ("position", "quaternion", "velocity", "angular_velocity", "torque", "force")
    fields = [(n, ctypes.c_float * (4 if n == "quaternion" else 3)) for n in names]
    fields += [(f"std_{n}", ctypes.c_float * 3) for n in PARTS]
    fields += [("nis", ctypes.c_float), ("status", ctypes.c_int), ("restarts", ctypes.c_uint)]
    if imu:
        for name in ("gyro_bias", "accelerometer_bias"):
            fields += [(name, ctypes.c_float * 3)]
        for name in ("std_gyro_bias", "std_accelerometer_bias"):
            fields += [(name, ctypes.c_float * 3)]
        fields += [("imu_refused", ctypes.c_uint)]
    return type("Estimate", (ctypes.Structure,), {"_fields_": fields})


def floats(values):
    return None if values is None else (ctypes.c_float * len(values))(*map(float, values))


class ExportedFilter:
    """A compiled export with the methods of the Python filter."""

    def __init__(self, exported, folder, compiler="gcc"):
        needs(compiler)
        write(exported, folder)
        (folder / "size.c").write_text(
            '#include "windwrench_filter.h"\nunsigned size_of_filter(void);\n'
            "unsigned size_of_filter(void) { return (unsigned)sizeof(ww_filter); }\n"
        )
        library = folder / "filter.so"
        run(
            compiler,
            *STRICT,
            "-O2",
            "-shared",
            "-fPIC",
            *("windwrench_filter.c", "size.c", "-o", library.name, "-lm"),
            cwd=folder,
        )
        self.c = ctypes.CDLL(str(library.resolve()))
        self.c.ww_predict.argtypes = [ctypes.c_void_p, FLOATS, ctypes.c_float]
        self.memory = ctypes.create_string_buffer(self.c.size_of_filter())
        self.now = estimate_type("gyro_bias" in exported.files["windwrench_filter.h"])()

    def reset(self, position, quaternion):
        return self.c.ww_init(self.memory, floats(position), floats(quaternion))

    def predict(self, rotor_speeds, dt):
        return self.c.ww_predict(self.memory, floats(rotor_speeds), dt)

    def correct(self, position, quaternion):
        return self.c.ww_correct_pose(self.memory, floats(position), floats(quaternion))

    def correct_imu(self, gyro, accelerometer):
        return self.c.ww_correct_imu(self.memory, floats(gyro), floats(accelerometer))

    @property
    def estimate(self):
        self.c.ww_get(self.memory, ctypes.byref(self.now))
        return self.now


def as_floats(flight):
    """A flight as single precision holds it: what both filters are given."""
    return {
        name: np.asarray(value, dtype=np.float32).astype(np.float64)
        for name, value in flight.items()
    }


def differences(c, python):
    """The largest difference of each part of two estimates, in standard deviations of the Python
    filter's, and the largest relative one of the standard deviations.
    """
    e, p = c.estimate, python.estimate
    std = np.sqrt(np.diag(p.covariance)).reshape(6, 3)
    std[0] *= 4.0  # an MRP is a quarter of an angle
    out = {}
    for k, name in enumerate(PARTS):
        if name == "attitude":
            q, r = np.array(e.quaternion, dtype=float), p.quaternion
            turn = np.array([r[0], -r[1], -r[2], -r[3]])
            x = q[0] * turn[1:] + turn[0] * q[1:] + np.cross(q[1:], turn[1:])
            difference = 2.0 * np.abs(x)
        else:
            difference = np.abs(np.array(getattr(e, name), dtype=float) - getattr(p, name))
        out[name] = float(np.max(difference / std[k]))
        mine = np.array(getattr(e, f"std_{name}"), dtype=float)
        out[f"std_{name}"] = float(np.max(np.abs(mine / std[k] - 1.0)))
    out["status"] = 0.0 if STATUSES[e.status] == p.status else 1.0
    out["restarts"] = float(abs(e.restarts - p.restarts))
    return out
