"""A fleet's logs, one diagnosis each, spread over workers; what is done is not done again."""

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from ...dynamics.vehicle_file import load_vehicle
from ...runtime.errors import InputError
from ...runtime.plain_values import as_text
from ...runtime.workers import Lost, each
from .flight import diagnose_one, key_of, refusal
from .manifest import FleetLog, natural
from .outcomes import Outcome, Outcomes

OUTCOMES = "outcomes.jsonl"
LIMIT_S = 600.0  # for one log; a minute of flight takes some seconds


def run_fleet(
    logs: Sequence[FleetLog],
    outcomes: Outcomes,
    without: tuple[str, ...] = (),
    limit_s: float = LIMIT_S,
    jobs: int | None = None,
    cluster: str | None = None,
    report: Callable[[Mapping[str, int]], None] = lambda counts: None,
) -> list[FleetLog]:
    """Diagnose every log that has no outcome yet; return all logs with the keys of their outcomes.

    A refusal for want of time, or of a process that died, is tried again where the limit is higher
    than it was.

    Args:
        logs: of the fleet.
        outcomes: what is done; it grows.
        without: effects taken out of the library.
        limit_s: what one log may take, s.
        jobs: processes; default: one a core.
        cluster: a Ray cluster's address, or ``local``; None: processes of this machine. Every
            machine of a cluster must find the logs under the same paths.
        report: called after each log with what was counted so far: ``kept``, ``diagnosed``,
            ``refused``.

    Raises:
        InputError: an outcome cannot be written, or there is no such cluster.
    """
    counts = {"kept": 0, "diagnosed": 0, "refused": 0}
    done: list[FleetLog] = []
    first: dict[str, str] = {}  # the first log of each key: another one is its copy

    def keep(key: str, outcome: Outcome) -> None:
        if outcomes.get(key) != {"key": key, **outcome}:
            outcomes.add({"key": key, **outcome})
        counts[outcome["status"]] += 1
        report(counts)

    def pending() -> Iterator[FleetLog]:
        for log in logs:
            unread = None
            try:
                key = key_of(log, without)
            except InputError as error:
                key, unread = _key_of_name(log), str(error)
            if key in first:
                unread = f"{log.path}: the same flight as {first[key]}, byte for byte"
                key = _key_of_name(log)
            first.setdefault(key, log.name)
            done.append(replace(log, key=key))
            if unread is not None:
                keep(key, refusal("input", unread))
            elif key not in outcomes or (
                outcomes[key].get("kind") in ("time", "died")
                and limit_s > outcomes[key].get("limit_s", limit_s)
            ):
                yield done[-1] if cluster is None else _absolute(done[-1])
            else:
                counts["kept"] += 1
                report(counts)

    work = partial(diagnose_one, without=without)
    for log, result in each(work, pending(), limit_s, jobs, cluster):
        if isinstance(result, Lost):
            result = refusal(result.kind, f"{log.path}: {result.words}") | {"limit_s": limit_s}
        keep(log.key, result)
    return done


def _key_of_name(log: FleetLog) -> str:
    """Return the key of a log's outcome where its bytes have none of their own."""
    return hashlib.blake2b(b"name:" + os.fsencode(log.path), digest_size=16).hexdigest()


def _absolute(log: FleetLog) -> FleetLog:
    """Return a log whose paths mean the same in every working folder."""

    def file(name: str | None) -> str | None:
        return os.path.abspath(name) if name and name.endswith((".yaml", ".yml")) else name

    name, colon, option = (log.reader or "").partition(":")
    reader = f"{name}:{os.path.abspath(option)}" if colon else log.reader
    path = os.path.abspath(log.path)
    return replace(log, path=path, vehicle=file(log.vehicle), reader=reader, map=file(log.map))


def rows(done: Sequence[FleetLog], outcomes: Outcomes) -> list[dict[str, Any]]:
    """Return each flight: its log, the individual, its place among that one's flights, its outcome;
    in the order of individuals and flights.
    """
    models = {file: load_vehicle(file).name for file in {log.vehicle for log in done} if file}
    named = []
    for log in done:
        flown = models.get(log.vehicle or "") or outcomes[log.key].get("vehicle", "unknown")
        named.append((log.id or flown, log))
    untimed = {name for name, log in named if log.time is None}

    def place(pair: tuple[str, FleetLog]) -> tuple[object, ...]:
        name, log = pair
        time = 0.0 if name in untimed else log.time or 0.0
        return natural(name), time, natural(log.name)

    flights: Counter[str] = Counter()
    found = []
    for name, log in sorted(named, key=place):
        flights[name] += 1
        known = {"id": as_text(name), "flight": flights[name], "log": as_text(log.name)}
        known |= {"time": log.time, "session": as_text(log.session)} | outcomes[log.key]
        found.append({key: x for key, x in known.items() if key not in ("key", "limit_s")})
    return found
