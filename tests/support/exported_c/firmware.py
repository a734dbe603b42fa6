"""An exported filter on a Cortex-M4F: cross-compiled, run under qemu, measured.

qemu counts instructions: with ``-icount shift=6`` each takes 64 ns of the board's time, so 1.6
ticks of its 25 MHz timer. A loop of 2,000 instructions checks that in every run. An instruction is
not a cycle: divisions and roots take 14 on a real one, and flash may wait.
"""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.support.exported_c.compiled import STRICT, run, write
from tests.support.paths import ROOT
from windwrench.live.export_c.numbers import table

Array = NDArray[np.float64]
_FOLDER = Path(__file__).parent / "board"
_CPU = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
TOOLS = ("arm-none-eabi-g++", "arm-none-eabi-size", "qemu-system-arm", "arm-none-eabi-gcc")
_COLUMNS = ("dt", "rotor_speeds", "position", "quaternion", "gyro", "accelerometer")


@dataclass(frozen=True)
class Measured:
    """What a filter needs on the microcontroller, and what it estimated there."""

    code: int  # bytes, of the filter's object: instructions and tables
    ram: int  # bytes, of one ww_filter
    stack: int  # bytes, at most, of a call
    predict: Array  # (n,) instructions of each ww_predict
    correct: Array  # (n,) of each ww_correct_pose
    status: Array  # (n,)
    estimates: Array  # (n, 19)
    loop: int  # instructions that the timer saw in the loop of 2,000


def fly(exported, flight, folder):
    """Fly a filter along a flight on the board, at most some thousand steps."""
    write(exported, folder)
    options = ("-Os", "-fno-math-errno", *_CPU)
    run(TOOLS[0], *options, *STRICT, "-c", "windwrench.cpp", "-o", "filter.o", cwd=folder)
    code = int(run(TOOLS[1], "filter.o", cwd=folder).splitlines()[1].split()[0])
    columns = [np.atleast_2d(flight[name].T).T for name in _COLUMNS if name in flight]
    rows = np.concatenate(columns, axis=1)
    unmeasured = "12345.678"  # a number that no flight has, where nothing was measured
    values = table(np.where(np.isfinite(rows), rows, float(unmeasured)), "flight")
    values = values.replace(f"{unmeasured}f", "NAN")
    (folder / "flight.h").write_text(
        f"#include <math.h>\n#define FLIGHT_STEPS {len(rows)}\n"
        + ("#define FLIGHT_IMU\n" if "gyro" in flight else "")
        + f"static const float flight[{len(rows)}][{rows.shape[1]}] = {values};\n"
    )
    for path in (_FOLDER / "bench.c", ROOT / "examples" / "board" / "mps2_an386.ld"):
        shutil.copy(path, folder)
    run(  # a C program: the filter needs no C++ library
        *(TOOLS[3], *options, "-std=c99", "-nostartfiles", "-I.", "bench.c", "filter.o"),
        *("-T", "mps2_an386.ld", "-o", "bench.elf", "-lm", "-lc", "-lgcc"),
        cwd=folder,
    )
    said = run(
        *(TOOLS[2], "-machine", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"),
        *("-chardev", "stdio,id=out", "-semihosting-config", "enable=on,target=native,chardev=out"),
        *("-icount", "shift=6,align=off,sleep=off"),
        *("-kernel", "bench.elf"),
        cwd=folder,
    )
    return _read(said, code)


def _read(said, code):
    words = {name: int(value, 16) for name, value in re.findall(r"^(\w+) (\w{8}) $", said, re.M)}
    rows = [
        [int(word, 16) for word in line.split()[1:]]
        for line in said.splitlines()
        if line.startswith("step ")
    ]
    if not said.endswith("end\n") or not rows:
        raise RuntimeError(f"the program on the board ended early: {said[-300:]}")
    numbers = np.array(rows, dtype=np.uint32)
    return Measured(
        code,
        words["size"],
        words["stack"],
        numbers[:, 0].astype(float),
        numbers[:, 1].astype(float),
        numbers[:, 3].astype(float),
        numbers[:, 4:].copy().view(np.float32).astype(float),
        round(words["loop"] * 5 / 8),
    )
