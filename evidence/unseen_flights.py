"""Vehicles from ``identify`` on flights that they have not seen, of three public sets.

| set | flights | vehicle |
| --- | --- | --- |
| NanoBench (syediu/nanobench-iros2026) | pose, PWM and voltage at 100 Hz | Crazyflie 2.1 |
| racer (NeuroBEM's c, e, g, republished with NeuroMHE) | an estimator's output, 200 Hz | 0.77 kg |
| brushless (IMRCLab/crazyflie-data-collection) | pose, IMU, RPM, 500 Hz | Crazyflie 2.1 Brushless |

A vehicle is identified from each group: two neighbouring flights (racer one, brushless four), and
every second flight. It predicts each flight outside its group from the logged state, every 0.25 s
for 0.5 s, off the ground. The logged state is the pose below 15 Hz with its derivatives. Flights
without 3 s of unbroken pose are left out. A cell is one of four mean errors by the better one of no
change and of the vehicle's thrust and drag. Cells of one flight or one vehicle are
not independent, so that intervals are too narrow.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from scipy.spatial.transform import Rotation

from windwrench import __version__
from windwrench.dynamics.vehicle import Vehicle
from windwrench.evidence.kept_results import DOCS
from windwrench.evidence.nanodrone_benchmark import WAYS, ways_of
from windwrench.evidence.runner import start
from windwrench.evidence.scoring import share
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.reading import read_log
from windwrench.identification.logs.table import Array
from windwrench.identification.motion.signals import log_signals, pose_pieces
from windwrench.identification.motion.smoothing import continuous, resampled
from windwrench.identification.prediction import QUANTITIES, errors_at, logged_starts
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.identification.vehicle_fit.result import IDENTIFIED
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit

RESULTS = "results/unseen_flights.json"  # below docs/
ALIKE = 1.02  # a cell up to this is no loss
_HORIZON = 0.5  # s


class FlightSet(NamedTuple):
    """Flights of one vehicle: their files below the data folder, and what ``identify`` is told."""

    files: str
    reader: str | None
    mass: float  # kg
    geometry: str
    few: int  # flights of a small group


SETS: Mapping[str, FlightSet] = {
    # the source states 27 g, without the markers' deck
    "NanoBench": FlightSet("nanobench/*.csv*", "nanobench", 0.034, "0.0325", 2),
    "racer": FlightSet("racer/flight_*", None, 0.772, "0.088", 1),
    "brushless": FlightSet("crazyflies/brushless_flights/data/*", None, 0.037, "0.0325", 4),
}


def groups_of(flights: Sequence[str], few: int) -> list[tuple[str, Sequence[str]]]:
    """Return neighbours, ``few`` at a time, and two halves of more than three flights, each with
    its name.
    """
    name = f"{few} flights" if few > 1 else "one flight"
    found = [(name, flights[i : i + few]) for i in range(0, len(flights) - few + 1, few)]
    halves = flights[::2], flights[1::2]
    return found + [("every second flight", half) for half in halves if len(flights) > 3]


def states_of(log: FlightLog) -> Array:
    """Return the logged states (N, 13) at each row, NaN outside unbroken stretches."""
    states = np.full((len(log.t), 13), np.nan)
    for s in log_signals(log):
        rows = (log.t >= s.t[0]) & (log.t <= s.t[-1])
        turned = continuous(Rotation.from_matrix(s.rotation).as_quat(scalar_first=True))
        known = np.hstack([s.position, turned, s.velocity, s.angular_velocity])
        states[rows] = resampled(log.t[rows], s.t, known)
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
    return states


def predicted(log: FlightLog, vehicle: Vehicle) -> dict[str, list[float]]:
    """Return the four mean errors after 0.5 s by each of ``WAYS``."""
    starts = logged_starts(log, vehicle, [(log.t[0], log.t[-1])], _HORIZON)
    starts = starts._replace(states=states_of(starts.log))
    errors = errors_at([starts], ways_of(vehicle))
    return {way: e.model[:, -1].tolist() for way, e in zip(WAYS, errors, strict=True)}


def flown(name: str, data: Path) -> list[dict[str, Any]]:
    """Return what the vehicle of each group says of each other flight of a set."""
    kind = SETS[name]
    paths = [path for path in sorted(data.glob(kind.files)) if path.suffix != ".yaml"]
    logs = {path.name.split(".")[0]: read_log(path, kind.reader) for path in paths}
    logs = {n: log for n, log in logs.items() if pose_pieces(log)}
    rows: list[dict[str, Any]] = []
    for of, group in groups_of(list(logs), kind.few):
        try:
            known = identify([logs[n] for n in group], kind.mass, parse_geometry(kind.geometry))
        except InputError as error:
            print(f"{name}, {', '.join(group)}: {error}", flush=True)
            rows.append({"of": of, "group": group, "refused": str(error)})
            continue
        thrust = known.estimates.get("k")
        errors = {n: predicted(log, known.vehicle) for n, log in logs.items() if n not in group}
        rows.append(
            {
                "of": of,
                "group": group,
                "torque": known.vehicle.status.torque,
                "closed_loop": known.vehicle.closed_loop is not None,
                "k": list(thrust[1:4]) if thrust and thrust.status == IDENTIFIED else None,
                "errors": errors,
            }
        )
        worst = max(cells(rows[-1:]))
        print(f"{name}, {', '.join(group)}: worst {worst[0]:.2f}, {worst[1]}", flush=True)
    return rows


def cells(rows: Iterable[Mapping[str, Any]]) -> Iterator[tuple[float, str]]:
    """Return ratios of errors, each with the quantity, the flight and the vehicle's flights."""
    for row in rows:
        group = row["group"]
        source = ", ".join(group) if len(group) < 5 else f"{row['of']}, {group[0]} first"
        for flight, by_way in row.get("errors", {}).items():
            vehicle, *simple = (np.array(by_way[way]) for way in WAYS)
            for quantity, ratio in zip(QUANTITIES, vehicle / np.min(simple, axis=0), strict=True):
                yield float(ratio), f"{quantity} of {flight} from {source}"


def page_rows(sets: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[tuple[str, str, str]]:
    """Return what was measured of each set by the size of a group, the result, and what stands
    beside.
    """
    lines = []
    for name, rows in sets.items():
        for size in dict.fromkeys(row["of"] for row in rows):
            some = list(cells(row for row in rows if row["of"] == size))
            fine, (worst, where) = sum(ratio <= ALIKE for ratio, _ in some), max(some)
            lines.append(
                (
                    f"{name}, vehicles of {size} on unseen flights: errors at most {ALIKE:g} times "
                    "the better one of no change and of thrust and drag",
                    f"{share(fine, len(some))}; worst {worst:.2f}: {where}",
                    "–",
                )
            )
        overlapping, pairs, apart = repeats(rows)
        if pairs:
            lines.append(
                (
                    f"{name}: 95 % intervals of `k` of two groups without a common flight overlap",
                    f"{share(overlapping, pairs)}; at most {100.0 * (apart - 1.0):.1f} % apart",
                    "95 % and more",
                )
            )
    return lines


def lost(sets: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Return the share of all cells with a loss."""
    some = [ratio for rows in sets.values() for ratio, _ in cells(rows)]
    return share(sum(ratio > ALIKE for ratio in some), len(some))


def repeats(rows: Sequence[Mapping[str, Any]]) -> tuple[int, int, float]:
    """Return of groups without a common flight: pairs whose intervals of ``k`` overlap, all pairs,
    and the largest ratio of two values.
    """
    known = [row for row in rows if row.get("k")]
    pairs = [
        (a["k"], b["k"]) for a, b in combinations(known, 2) if not set(a["group"]) & set(b["group"])
    ]
    overlapping = sum(a[1] <= b[2] and b[1] <= a[2] for a, b in pairs)
    apart = max((max(a[0] / b[0], b[0] / a[0]) for a, b in pairs), default=1.0)
    return overlapping, len(pairs), apart


def study(
    data: Annotated[Path, typer.Option(help="Folder of the sets' folders.")] = Path(
        "../shared/data"
    ),
    out: Annotated[Path, typer.Option(help="Results file.")] = DOCS / RESULTS,
    only: Annotated[list[str] | None, typer.Option(help="Name of a set, once for each.")] = None,
) -> None:
    """Identify on some flights and predict the others. Sets without a flight are left out."""
    result: dict[str, Any] = {"version": __version__, "commit": commit(), "sets": {}}
    for name in only or SETS:
        if any(data.glob(SETS[name].files)):
            result["sets"][name] = rows = flown(name, data)
            write_json(result, out)
            print(*page_rows({name: rows}), sep="\n", flush=True)


if __name__ == "__main__":
    start(study)
