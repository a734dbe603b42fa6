"""An exported filter, compiled on this machine and driven from Python."""

import ctypes
import shutil

import numpy as np
import pytest

from tests.support.programs import said
from windwrench.estimator.estimate import STATUSES

_WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
STRICT = ("-std=c++17", "-fno-exceptions", "-fno-rtti", *_WARNINGS)
STRICT_C = ("-std=c99", *_WARNINGS)
PARTS = ("attitude", "angular_velocity", "position", "velocity", "torque", "force")
_NUMBERS = {"single": ctypes.c_float, "double": ctypes.c_double}


def missing(*programs):
    """Return which of some programs are not installed."""
    return [program for program in programs if shutil.which(program) is None]


def needs(*programs):
    """Skip a test where one of some programs is not installed."""
    if lacking := missing(*programs):
        pytest.skip(f"not installed: {', '.join(lacking)}")


needs_gcc = pytest.mark.skipif(bool(missing("gcc", "g++")), reason="not installed: gcc")


def write(exported, folder):
    """Write the files of an export into a folder; return it."""
    for name, text in exported.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def run(*words, cwd):
    return said(*map(str, words), cwd=cwd, timeout=600.0)


def _estimate_type(imu, number):
    names = ("position", "quaternion", "velocity", "angular_velocity", "torque", "force")
    fields = [(n, number * (4 if n == "quaternion" else 3)) for n in names]
    fields += [(f"std_{n}", number * 3) for n in PARTS]
    fields += [("nis", number), ("status", ctypes.c_int), ("restarts", ctypes.c_uint)]
    fields += [("noise_scale", number), ("dead_reckoning", number)]
    if imu:
        biases = ("gyro_bias", "accelerometer_bias", "std_gyro_bias", "std_accelerometer_bias")
        fields += [(name, number * 3) for name in biases]
        fields += [("imu_refused", ctypes.c_uint)]
    return type("Estimate", (ctypes.Structure,), {"_fields_": fields})


class CompiledFilter:
    """An export, compiled, with the methods of the Python filter; each returns what C returns."""

    def __init__(self, exported, folder):
        write(exported, folder)
        header = exported.files["windwrench.h"]
        lines = ['#include "windwrench.h"']
        with_policy = "ww_policy" in header
        for name, type_ in (("filter", "ww_filter"), ("policy", "ww_policy_memory"))[
            : 1 + with_policy
        ]:
            head = f"unsigned size_of_{name}(void)"
            lines += [f'extern "C" {head};', f"{head} {{ return (unsigned)sizeof({type_}); }}"]
        (folder / "size.cpp").write_text("\n".join([*lines, ""]))
        library = folder / "filter.so"
        run(
            *("g++", *STRICT, "-O1", "-fno-math-errno", "-shared", "-fPIC"),
            *("windwrench.cpp", "size.cpp", "-o", library.name, "-lm"),
            cwd=folder,
        )
        self.c = ctypes.CDLL(str(library.resolve()))
        self._number = _NUMBERS[exported.precision]
        pointer = ctypes.POINTER(self._number)
        self.c.ww_predict.argtypes = [ctypes.c_void_p, pointer, self._number]
        self.memory = ctypes.create_string_buffer(int(self.c.size_of_filter()))
        self._now = _estimate_type("gyro_bias" in header, self._number)()
        if with_policy:
            self.c.ww_policy.restype = self._number
            self.policy_bytes = int(self.c.size_of_policy())
            self._policy = ctypes.create_string_buffer(self.policy_bytes)
            self.c.ww_policy_init(self._policy)

    def _array(self, values):
        return None if values is None else (self._number * len(values))(*map(float, values))

    def _call(self, function, *arrays):
        return int(function(self.memory, *map(self._array, arrays)))

    def reset(self, position, quaternion):
        """Call ww_init."""
        return self._call(self.c.ww_init, position, quaternion)

    def predict(self, rotor_speeds, dt, voltage=None):
        """Call ww_predict, and before it ww_set_voltage where a voltage is given."""
        if voltage is not None:
            self.c.ww_set_voltage(self.memory, self._number(voltage))
        return int(self.c.ww_predict(self.memory, self._array(rotor_speeds), dt))

    def correct(self, position, quaternion):
        """Call ww_correct_pose."""
        return self._call(self.c.ww_correct_pose, position, quaternion)

    def correct_imu(self, gyro, accelerometer):
        """Call ww_correct_imu."""
        return self._call(self.c.ww_correct_imu, gyro, accelerometer)

    def policy(self, estimate):
        """Call ww_policy."""
        return float(self.c.ww_policy(self._policy, ctypes.byref(estimate)))

    @property
    def estimate(self):
        """What ww_get writes; the next call writes over it."""
        self.c.ww_get(self.memory, ctypes.byref(self._now))
        return self._now


def differences(c, python):
    """Return the largest difference of each part of two estimates, in standard deviations of noise
    in the Python filter's; that of the stated standard deviations, relative; and whether status or
    restarts differ.
    """
    e = c.estimate
    p = python.estimate
    std = p.std.reshape(6, 3).copy()
    std[0] *= 4.0  # an MRP is a quarter of an angle
    stated = np.concatenate([std[:4], p.std_wrench.reshape(2, 3)])
    out = {}
    for k, name in enumerate(PARTS):
        if name == "attitude":
            q = np.array(e.quaternion, dtype=float)
            r = p.quaternion
            turn = r[0] * q[1:] - q[0] * r[1:] - np.cross(q[1:], r[1:])
            difference = 2.0 * np.abs(turn)
        else:
            difference = abs(np.array(getattr(e, name), dtype=float) - getattr(p, name))
        out[name] = float(np.max(difference / std[k]))
        mine = np.array(getattr(e, f"std_{name}"), dtype=float)
        out["std"] = max(out.get("std", 0.0), float(abs(mine / stated[k] - 1.0).max()))
    same = STATUSES[e.status] == p.status and e.restarts == p.restarts
    out["status"] = 0.0 if same else 1.0
    return out


def begin(one, flight):
    """Start a filter at the first whole pose of a flight; return its row."""
    first = int(np.flatnonzero(np.isfinite(flight["position"]).all(axis=1))[0])
    one.reset(flight["position"][first], flight["quaternion"][first])
    return first


def take(one, flight, k, *voltage):
    """Take in row ``k`` of a flight."""
    one.predict(flight["rotor_speeds"][k], flight["dt"][k], *voltage)
    if "gyro" in flight:
        one.correct_imu(flight["gyro"][k], flight["accelerometer"][k])
    one.correct(flight["position"][k], flight["quaternion"][k])


def compare(c, python, flight, every=1):
    """Fly both filters along a flight of ``flights``; return the largest of ``differences``, looked
    at ``every`` so many steps, and the count of restarts. C is told a ``voltage`` (n,) when it
    changes; until then it takes the battery for full.
    """
    first = begin(c, flight)
    begin(python, flight)
    worst = {}
    voltage = flight.get("voltage")
    told = ()
    given = ()
    for k in range(first + 1, len(flight["dt"])):
        if voltage is not None:
            told = (voltage[k],) if voltage[k] != voltage[k - 1] else ()
            given = (np.nan_to_num(voltage[k]),)
        take(c, flight, k, *told)
        take(python, flight, k, *given)
        if k % every == 0:
            for name, value in differences(c, python).items():
                worst[name] = max(worst.get(name, 0.0), value)
    worst["restarts"] = float(python.estimate.restarts)
    return worst
