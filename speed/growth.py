"""How cost grows with the work: over a million steps of a filter, with the number of vehicles, with
the length of a log.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from ..dynamics import load_vehicle
from ..estimator import UKFTuning, WrenchUKF
from .contenders import Section
from .filter_step import PERIOD, make_run, time_batch
from .flight_speed import many, many_us

COUNTS = (1, 4, 16, 64, 256, 1024, 4096)  # filters
WORLDS = (1, 4, 16, 64, 256)  # environments
_MORE_ROUNDS = 4  # of flights on threads: the ratio of two runs of 0.1 s varies most of all


def resident() -> float:
    """Return the memory that this process holds now, MB; NaN where the system does not say."""
    if not sys.platform.startswith("linux"):
        return float("nan")
    import resource

    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


def over_steps(steps: int = 1_000_000, parts: int = 10) -> Section:
    """Return time a step and memory over the parts of a long run of one filter, from Python."""
    run = make_run(1000)
    ukf = WrenchUKF(load_vehicle("ardrone2"), UKFTuning(), PERIOD)
    ukf.reset(
        run.initial_position,
        run.initial_quaternion,
        run.initial_covariance,
        run.initial_velocity,
        run.initial_angular_velocity,
    )
    samples = list(
        zip(run.rotor_speeds, run.measured_position, run.measured_quaternion, strict=True)
    )
    # there and back: the flight closes, and the filter never has to jump
    samples = samples + samples[::-1]
    rows = []
    for part in range(parts):
        count = steps // parts
        begin = time.perf_counter()
        for k in range(count):
            ukf.step(*samples[k % len(samples)])
        rows.append(
            [
                f"{(part + 1) * count:,}",
                f"{1e6 * (time.perf_counter() - begin) / count:.2f}",
                f"{resident():.0f}",
            ]
        )
    return Section(
        "Over a million steps of one filter",
        ["steps so far", "us a step", "memory, MB"],
        rows,
        "From Python, with the loop's own time; memory is that of the whole process.",
    )


def over_vehicles(
    rounds: int = 5, counts: tuple[int, ...] = COUNTS, worlds: tuple[int, ...] = WORLDS
) -> Section:
    """Return the time of one filter's step in batches of growing size, and of one environment's
    tick likewise.
    """
    run = make_run(8)
    filters = {count: time_batch(run, count) for count in counts}
    flights = {count: many_us(count) for count in worlds}
    taken: dict[tuple[str, int], list[float]] = {}
    for _ in range(rounds):
        for kind, group in (("filter", filters), ("world", flights)):
            for count, work in group.items():
                taken.setdefault((kind, count), []).append(work())
    rows = [
        [
            f"{count:,}",
            *(
                f"{statistics.median(taken[kind, count]):.2f}" if (kind, count) in taken else ""
                for kind in ("filter", "world")
            ),
        ]
        for count in sorted({*counts, *worlds})
    ]
    # a small batch pays for the call itself
    middle = [
        statistics.median(taken["filter", count])
        for count in counts
        if count >= 64 or count == counts[-1]
    ]
    return Section(
        "With the number of vehicles",
        ["vehicles", "us a filter's step", "us an environment's tick"],
        rows,
        "Time for each vehicle: flat where cost is linear in their number. From 64 filters on, the "
        "most expensive batch "
        f"costs {max(middle) / min(middle):.2f} times the cheapest, a vehicle.",
    )


# environments in a process of their own: one run a line
_PROCESS = """
import sys
from windwrench.speed.flight_speed import many
run = many(int(sys.argv[1]))
for line in sys.stdin:
    print(run(), flush=True)
"""


def over_threads(rounds: int = 5, worlds: tuple[int, ...] = (16, 64, 256)) -> Section:
    """Return how fast environments fly on one thread, on one for each core, and in as many
    processes as there are cores.
    """
    cores = os.cpu_count() or 1
    fly = {
        count: (many(count), many(count, threads=cores), [_process(count) for _ in range(cores)])
        for count in worlds
    }
    taken: dict[int, list[tuple[float, float, float]]] = {count: [] for count in worlds}
    for _ in range(_MORE_ROUNDS * rounds + 1):
        for count, (alone, spread, processes) in fly.items():
            taken[count].append((alone(), spread(), _run_all(processes)))
    rows = []
    for count, (_, _, processes) in fly.items():
        for process in processes:
            process.communicate()
        found = taken[count][1:]  # the first one compiles
        speeds = [statistics.median(column) for column in zip(*found, strict=True)]
        gains = [statistics.median(row[k] / row[0] for row in found) for k in (1, 2)]
        rows.append(
            [
                f"{count:,}",
                *(f"{speed:.0f}" for speed in speeds),
                *(f"{gain:.2f}" for gain in gains),
            ]
        )
    return Section(
        "With the number of threads",
        [
            "environments",
            "one thread",
            f"{cores} threads",
            f"{cores} processes",
            "threads / one",
            "processes / one",
        ],
        rows,
        f"Times real time, summed over the environments; the last columns are medians of the "
        f"ratios of "
        f"{_MORE_ROUNDS * rounds} rounds, as a machine's second core comes and goes. "
        "Processes, with as many environments each, have nothing in common but the machine: more "
        "than they gain, "
        "threads cannot.",
    )


def _process(count: int) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _PROCESS, str(count)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _run_all(processes: Sequence[subprocess.Popen[str]]) -> float:
    """Have all processes run once, together; return the sum of what they measured."""
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    total = 0.0
    for process in processes:
        assert process.stdout is not None
        total += float(process.stdout.readline())
    return total


def over_formats(rounds: int = 5, seconds: float = 60.0) -> Section:
    """Return the time in which a log is read and checked, in each form that logs are written in."""
    from ..identification.logs.flight_log import write_log
    from ..identification.logs.reading import read_log

    taken: dict[str, list[float]] = {}
    sizes: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        first = Path(name) / "flight.csv"
        subprocess.run(
            [
                sys.executable,
                "-m",
                "windwrench",
                "record",
                "--seconds",
                f"{seconds:g}",
                "--out",
                str(first),
                "--quiet",
            ],
            check=True,
        )
        log = read_log(first)
        files = [first, *(first.with_suffix(suffix) for suffix in (".csv.gz", ".parquet"))]
        for file in files[1:]:
            write_log(log, file)
        for _ in range(rounds):
            for file in files:
                begin = time.perf_counter()
                read_log(file)
                taken.setdefault(file.name, []).append(time.perf_counter() - begin)
                sizes[file.name] = file.stat().st_size / 1e6
    rows = [
        [
            name.partition(".")[2],
            f"{sizes[name]:.1f}",
            *(f"{f(values):.3f}" for f in (statistics.median, min, max)),
        ]
        for name, values in taken.items()
    ]
    return Section(
        "Reading a log",
        ["form", "MB", "s", "least", "most"],
        rows,
        f"{seconds:g} s of flight at 200 Hz, read and checked.",
    )


# its children are one diagnosis alone
_DIAGNOSE = """
import resource, subprocess, sys, time
begin = time.perf_counter()
subprocess.run([sys.executable, "-m", "windwrench", "diagnose", *sys.argv[1:]], check=True)
print(time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)
"""


def over_logs(seconds: Sequence[float] = (60.0, 600.0)) -> Section:
    """Return the time and the greatest memory of a diagnosis of logs of growing length, each in a
    process of its own.
    """
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for length in (seconds[0], *seconds):  # the first one compiles
            log = folder / f"{length:g}.csv"
            subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "windwrench",
                    "record",
                    "--effect",
                    "rotor_drag",
                    "--seconds",
                    f"{length:g}",
                    "--out",
                    str(log),
                    "--quiet",
                ],
                check=True,
            )
            done = subprocess.run(
                [
                    sys.executable,
                    "-c",
                    _DIAGNOSE,
                    str(log),
                    "--vehicle",
                    "ardrone2",
                    "--out",
                    str(folder / "diagnosis"),
                    "--quiet",
                ],
                check=True,
                capture_output=True,
                text=True,
            )
            taken, memory = (float(word) for word in done.stdout.split())
            rows.append(
                [f"{length:,.0f}", f"{taken:.1f}", f"{taken / length:.3f}", f"{memory:.0f}"]
            )
    header = ["flight, s", "diagnosis, s", "s for a second of flight", "memory, MB"]
    return Section(
        "With the length of a log",
        header,
        rows[1:],
        "A process of its own, from the start of Python to the written report, with one effect "
        "that is not "
        "declared, at 200 Hz. Of flights of more than eight minutes, windows of a minute spread "
        "over them are "
        "looked at; reading and checking the log is what still grows.",
    )
