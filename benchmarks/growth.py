"""How cost grows with the work: over a million steps of a filter, and with the number of vehicles."""

import statistics
import sys
import time

from ..dynamics import load_vehicle
from ..estimator import UKFTuning, WrenchUKF
from .filter_step import PERIOD, make_run, time_batch
from .flight_speed import many_us
from .speed import Section

COUNTS = (1, 4, 16, 64, 256, 1024, 4096)  # filters
WORLDS = (1, 4, 16, 64, 256)  # environments


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
    ukf.reset(run.initial_position, run.initial_quaternion, run.initial_covariance, run.initial_velocity,
              run.initial_angular_velocity)
    samples = list(zip(run.rotor_speeds, run.measured_position, run.measured_quaternion, strict=True))
    # there and back: the flight closes, and the filter never has to jump
    samples = samples + samples[::-1]
    rows = []
    for part in range(parts):
        count = steps // parts
        begin = time.perf_counter()
        for k in range(count):
            ukf.step(*samples[k % len(samples)])
        rows.append([f"{(part + 1) * count:,}", f"{1e6 * (time.perf_counter() - begin) / count:.2f}", f"{resident():.0f}"])
    return Section("Over a million steps of one filter", ["steps so far", "us a step", "memory, MB"], rows,
                   "From Python, with the loop's own time; memory is that of the whole process.")


def over_vehicles(rounds: int = 5, counts: tuple[int, ...] = COUNTS, worlds: tuple[int, ...] = WORLDS) -> Section:
    """Return the time of one filter's step in batches of growing size, and of one environment's tick likewise."""
    run = make_run(8)
    filters = {count: time_batch(run, count) for count in counts}
    flights = {count: many_us(count) for count in worlds}
    taken: dict[tuple[str, int], list[float]] = {}
    for _ in range(rounds):
        for kind, group in (("filter", filters), ("world", flights)):
            for count, work in group.items():
                taken.setdefault((kind, count), []).append(work())
    rows = [[f"{count:,}", *(f"{statistics.median(taken[kind, count]):.2f}" if (kind, count) in taken else ""
                             for kind in ("filter", "world"))] for count in sorted({*counts, *worlds})]
    # a small batch pays for the call itself
    middle = [statistics.median(taken["filter", count]) for count in counts if count >= 64 or count == counts[-1]]
    return Section("With the number of vehicles", ["vehicles", "us a filter's step", "us an environment's tick"], rows,
                   "Time for each vehicle: flat where cost is linear in their number. From 64 filters on, the dearest batch "
                   f"costs {max(middle) / min(middle):.2f} times the cheapest, a vehicle.")
