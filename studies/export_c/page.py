"""The page of the exported filter: every figure from the results."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from windwrench.dynamics.effects import names
from windwrench.live.export_c.effect_code import exportable_effects, refusal
from windwrench.live.export_c.tracker import PARTICLES
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.export_c.compiled import PARTS
from windwrench.studies.export_c.firmware import CLOCK

Result = Mapping[str, Any]  # as ``study.run`` returns it


def _percent(value: float) -> str:
    return f"{100.0 * value:.2f}"


def _worst(found: Result) -> float:
    """Return the largest difference of any part, in standard deviations."""
    return max(float(found[part]) for part in PARTS)


def _agreement(rows: list[Mapping[str, Any]]) -> list[str]:
    out = [
        "| filter | flight | "
        + " | ".join(p.replace("_", " ") for p in PARTS)
        + " | std | restarts | steps over 1 %, % | in double, most |",
        "|---|---|" + "---:|" * (len(PARTS) + 4),
    ]
    for row in rows:
        single, double = row["single"], row["double"]
        cells = [_percent(single[p]) for p in (*PARTS, "std")]
        cells += [f"{single['restarts']:.0f}", _percent(single["over"])]
        cells.append(f"{100.0 * _worst(double):.1g}")
        out.append(f"| {row['estimator']} | {row['flight']} | {' | '.join(cells)} |")
    return out


def _browser(rows: list[Mapping[str, Any]]) -> str:
    """Return what was found of the filters as WebAssembly."""
    sizes = ", ".join(f"{row['estimator']} {row['bytes']:,}" for row in rows)
    apart = max(row["apart"] for row in rows)
    other = sum(row["status"] for row in rows)
    return (
        "The source compiles to WebAssembly, for a page in a browser, with clang and LLVM's linker, "
        "and without a C library. `studies/export_c/webassembly.py` has the command, and "
        "`studies/export_c/browser/` the lines of C and JavaScript around it. Bytes of the module: "
        f"{sizes}. It was flown by Node.js along {rows[0]['steps']:,} steps with faults. Estimates differ "
        f"from those of the same C compiled for this machine by {_percent(apart)} % of a standard "
        f"deviation at most, and statuses in {other} steps. The reason: sine and cosine are JavaScript's. "
        "No page of this kit uses it."
    )


def _board(rows: list[Mapping[str, Any]]) -> list[str]:
    out = [
        "| filter | compiled with | instructions, tables, bytes | `ww_filter`, bytes | stack, bytes "
        "(with faults) | instructions a predict | a pose | both at 168 MHz, us | longest call, us |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        both = row["predict"] + row["correct"]
        out.append(
            f"| {row['estimator']} | `{row['optimise']}` | {row['code'] - row['tables']:,} + "
            f"{row['tables']:,} | {row['ram']:,} | {row['stack']:,} ({row['stack_with_faults']:,}) "
            f"| {row['predict']:,.0f} | {row['correct']:,.0f} | {1e6 * both / CLOCK:.0f} "
            f"| {1e6 * row['longest_call'] / CLOCK:,.0f} |"
        )
    return out


def _with_imu(rows: list[Mapping[str, Any]]) -> list[str]:
    out = [
        "| filter | compiled with | instructions a predict | a pose | an IMU sample | "
        "all three at 168 MHz, us |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for row in rows:
        if "with_imu" in row:
            felt = row["with_imu"]
            total = felt["predict"] + felt["correct"] + felt["imu"]
            out.append(
                f"| {row['estimator']} | `{row['optimise']}` | {felt['predict']:,.0f} "
                f"| {felt['correct']:,.0f} | {felt['imu']:,.0f} | {1e6 * total / CLOCK:.0f} |"
            )
    return out


def _policies(rows: list[Result]) -> list[str]:
    out = [
        "| policy | code and tables, bytes | `ww_policy_memory`, bytes | instructions a decision | at 168 MHz, us |",
        "|---|---:|---:|---:|---:|",
    ]
    return out + [
        f"| {row['name']} | {row['code']:,} | {row['ram']:,} | {row['decision']:,} "
        f"| {1e6 * row['decision'] / CLOCK:,.0f} |"
        for row in rows
    ]


def write_page(result: Result, data: Path, page: Path) -> None:
    """Write the page that shows the results in ``data``.

    Raises:
        InputError: it cannot be written.
    """
    write_text("\n".join(_lines(result, data)) + "\n", page)


def _lines(result: Result, data: Path) -> list[str]:
    board = {(row["estimator"], row["optimise"]): row for row in result["board"]}
    small = board["constant-gain", "-Os"]
    single = [row["single"] for row in result["agreement"]]
    worst, spread = max(map(_worst, single)), max(found["std"] for found in single)
    double = max(_worst(row["double"]) for row in result["agreement"])
    apart = [row for row in result["agreement"] if row["single"]["over"] > 0.0]
    other = sum(row[p]["status"] for row in result["agreement"] for p in ("single", "double"))
    steps = result["steps"] * len({row["flight"] for row in result["agreement"]})
    refused = {n: refusal(n) for n in names()}
    over = small["code"] - 8_192
    size = (
        f"* **The constant gain needs {small['code']:,} bytes of flash with `-Os`**, "
        f"{small['tables']:,} of them tables: {over:,} more than the 8 kB aimed at."
        if over > 0
        else f"* The constant gain needs {small['code']:,} bytes of flash with `-Os`, {-over:,} fewer "
        "than 8 kB, and that without declared effects. An effect, or a centre of mass that is off, "
        "needs more (10 kB with four effects)."
    )
    felt = [sum(row["with_imu"].values()) for row in result["board"] if "with_imu" in row]
    gap = max(row["longest_call"] for row in result["board"] if row["estimator"] == "constant-gain")
    causes = (
        f"* **Now and then C and Python differ.** On {len(apart)} of {len(result['agreement'])} "
        "flights below some estimate differed by more than 1 % of its standard deviation, in at "
        f"most {_percent(max(found['over'] for found in single))} % of a flight's steps. The most "
        f"was {_percent(worst)} %. These flights are: "
        f"{'; '.join(row['estimator'] + ', ' + row['flight'] for row in apart)}. "
        if apart
        else "* C and Python agreed within 1 % of a standard deviation on all flights below. "
    ) + (
        f"The cause is single precision and nothing else: the same source in double differs by "
        f"{100.0 * double:.1g} % at most. "
        + (
            "Statuses and counts of restarts never differed."
            if not other
            else f"Statuses or counts of restarts differed on {other:.0f} flights."
        )
    )
    return [
        "# The filter in C, for a flight controller",
        "",
        "`windwrench export-c` writes the filter of your vehicle as one header and one C99 source. "
        "It has single precision unless told otherwise, no heap, no recursion and no global variables. "
        "Of libm it needs `sqrtf`, `sinf`, `cosf`, `fabsf`.",
        "",
        "```sh",
        "windwrench export-c --vehicle ardrone2 --estimator ekf --policy sac-0 --out filter",
        "```",
        "",
        "Then, with any C99 compiler:",
        "",
        "```text",
        "cmake -S filter -B build && cmake --build build && build/windwrench_example",
        "```",
        "",
        "## What it does not do, and what was not tried",
        "",
        causes,
        size,
        f"* **Its memory is {small['ram']:,} bytes, but its stack is {small['stack_with_faults']:,} "
        "bytes** while it runs with its covariance. A task with a small stack overflows then, and "
        "not in a calm hover.",
        "* **The covariance of the constant gain is that of hover**, in C and in Python. After a gap "
        "in steep or fast flight its deviations are approximate. A test holds those of half a second "
        "unseen, in a flight that turns and translates, between 0.4 and 1.6 of the full filter's.",
        f"* **One call after a gap of 0.1 s took {1e6 * gap / CLOCK:,.0f} us** with the constant "
        "gain: it makes up for the gap in up to 32 predictions at once. EKF and UKF have no such call.",
        f"* An IMU sample costs more than a pose; with one at every step the most is "
        f"{1e6 * max(felt) / CLOCK:,.0f} us at 168 MHz (table below).",
        "* Instructions are counted by an emulator, and taken as one cycle each. A real Cortex-M4 "
        "needs more: a division or a root takes 14 cycles, a load often two, and flash may wait. "
        "Nothing here was run on a board.",
        "* It was not tried in Simulink, in PX4 or on a Crazyflie.",
        "* Not in C: poses that come late (`TimedFilter`), the mass as a state, smoothing, fitting "
        "the noise to a log.",
        "* Effects that cannot be exported, each with its reason:",
        *(f"    * {n} ({why})" for n, why in refused.items() if why),
        "* In Python every estimator takes these effects. `--effects none` leaves out all that are declared. Recurrent policies, and those that "
        "see what is not in the estimate, are refused too.",
        "* `--policy tracker` knows the fan and the air of the scenario `base`, and no others.",
        "* A gap of exactly 0.1 s or 0.6 s may be judged a step earlier or later than in Python: a "
        "sum of single-precision steps is not exact.",
        "* Positions are single precision: 100 m from the origin a step of the number is 8 um. Keep "
        "the origin where the vehicle flies.",
        "",
        "## How to call it",
        "",
        '```c title="on_pose.c"',
        '#include "windwrench_filter.h"',
        "",
        "static ww_filter filter; /* one a vehicle; its fields are no part of the interface */",
        "",
        "/* before the first of these calls, once: ww_init(&filter, position, quaternion); */",
        "void on_pose(const float rotor_speeds[4], float dt, const float position[3], const float quaternion[4],",
        "             const float gyro[3], const float accelerometer[3], ww_estimate *estimate)",
        "{",
        "    ww_predict(&filter, rotor_speeds, dt);          /* rad/s, the mean of dt s since the last pose */",
        "    ww_correct_pose(&filter, position, quaternion); /* NULL or NaN: not measured */",
        "    ww_correct_imu(&filter, gyro, accelerometer);   /* if there is one; before or after the pose */",
        "    ww_get(&filter, estimate);                      /* force, torque, their std, status */",
        "}",
        "```",
        "",
        "* Without a pose call `ww_predict` alone at the filter's rate. The filter coasts, holds what "
        "is lost, and restarts at the next pose: `status` says which.",
        "* An IMU that is faster than the pose: `ww_predict` over each of its periods, then "
        "`ww_correct_imu`; noise is stated for a period and scaled with dt.",
        "* Frames are those of the whole kit: world z up, body x forward, y left, z up, quaternion "
        "scalar first, body to world. From PX4 (FRD in NED) turn both first.",
        "* `ww_policy`, where `--policy` is given, is called every 0.08 s with an estimate, and "
        "returns the velocity (m/s) that is commanded along the world's y axis. `lead` is "
        "`u = -(11.35 x + 2.79 dx/dt)` with `x = tau_z / max(f_x, 0.183)`. `tracker` is a particle "
        "filter on the fan's place and velocity (`controllers/tracker.py`). It has "
        f"{PARTICLES} particles, random numbers of its own (xorshift), and the jet's map as "
        "a table. Given the same random numbers Python commands the same to 1e-3 m/s, until rounding "
        "once draws another particle.",
        "* `--precision double` writes the same source with `double` in place of `float` and all digits "
        "of its numbers. It is for a processor that has a unit for it (Cortex-M7 with a double unit, "
        "Cortex-A, a PC). It takes about twice the memory. What is left of rounding is the polynomials for "
        "exponential, logarithm and arctangent, which are those of single precision.",
        "* `ww_set_voltage`, where the effect `battery_sag` is declared, tells the battery's voltage.",
        "* Not for `-ffast-math`, which knows no NaN: the source refuses to compile. "
        "`-fno-math-errno` makes roots a single instruction.",
        "* Files that are there already stay as they are, unless `--overwrite` is given: `main.c` "
        "may be yours.",
        "",
        "**Simulink.** Simulink's C Caller block calls plain C functions that a header declares. Name "
        "the header and the source under Simulation Target in the model's settings. Call the five "
        "functions in the order above. Keep one `ww_filter` a vehicle in your own C file, with a "
        "function of plain arrays around the calls, so that the block sees arrays alone. Give NaN "
        "for what was not measured. **This was not tried in Simulink.** What was tried is Python's "
        "`ctypes`: `tests/live/test_export_c.py` drives the same functions.",
        "",
        "## How C and Python are kept one",
        "",
        "* Every number (vehicle, noise, prior, gate, gain) is read from the Python filter's own "
        "memory when the C is written.",
        "* The equations of effects are translated from their Python when the C is written "
        "(`live/export_c/effect_code.py`); there is no second copy. Exported can be: "
        + ", ".join(exportable_effects())
        + ".",
        "* The filter's own equations are written twice, in `estimator/` and in the templates of "
        "`live/export_c/templates/`, and held together by tests. They cover five flights with gaps, jumps, "
        "turned poses and halves of poses, statuses and restarts included. They also cover each "
        "exportable effect, the policies, and gyro and accelerometer with bias, vibration and "
        "saturation.",
        "* Some things differ on purpose. Poses are taken in one number after the other, which is the "
        "same in exact numbers and loses less in single precision. An IMU's biases are rows of the "
        "covariance. Derivatives of effects (EKF) are taken over wider steps. The unscented prediction is "
        "that of a linear model and what the sigma points add to it, which is the same sum.",
        "",
        "## C against Python",
        "",
        f"The largest difference over {result['steps']:,} steps of each flight ({steps:,} a filter), "
        "in per cent of the estimate's own standard deviation at that step. `std`: the largest "
        f"relative difference of a standard deviation. Largest of all: {_percent(worst)} % and "
        f"{_percent(spread)} %. Flights on which a status or a count of restarts was ever another: "
        f"{other:.0f} of {len(single)}, in single and in double. `in double, most`: the largest "
        "difference of any part, of the same source with `--precision double`. These are maxima, so there is no interval. "
        "Flights are simulated, with a fault of the pose about every second.",
        "",
        *_agreement(result["agreement"]),
        "",
        "## On a Cortex-M4F",
        "",
        "Cross-compiled with Debian's `gcc-arm-none-eabi` and run by `qemu-system-arm` as the board "
        "mps2-an386. There every instruction takes 64 ns of the board's time (`-icount shift=6`), "
        "and the processor's timer counts it; a loop of 2,000 instructions read "
        f"{result['board'][0]['loop_of_2000']:,}, its call included. Sizes are those of "
        "`arm-none-eabi-size` for the filter's object, without libm's `sinf` and `cosf`; the stack is what was painted over. Median over "
        "1,000 steps of a calm flight; the longest call is of a flight with faults.",
        "",
        *_board(result["board"]),
        "",
        "With gyro and accelerometer at every step, biases and their covariance included:",
        "",
        *_with_imu(result["board"]),
        "",
        "What a policy takes beside the EKF, compiled with `-Os`; the longest decision of a calm "
        "flight, one every 80 ms:",
        "",
        *_policies(board["ekf", "-Os"]["policies"]),
        "",
        "Aims were: constant gain 8 kB of code, 1 kB of memory, 50 us; EKF or UKF 40 kB, 16 kB, "
        "1 ms.",
        "",
        "## In a browser",
        "",
        _browser(result["browser"]),
        "",
        made_by("python -m studies.export_c", [result["commit"]]),
        "",
        f"[The numbers of this page]({data.parent.name}/{data.name}).",
    ]
