"""The diagnosis of the measured flight that comes with the kit, beside what is known of it."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..identification.logs.example import Example
from .terminal import console


def _print(text: str) -> None:
    console.print(text, highlight=False, markup=False)


def introduce(example: Example) -> None:
    """Say what flew, and what is known of it."""
    _print(f"{example.what} ({example.source})")
    _print("Known before the diagnosis:")
    for known in example.known:
        _print(f"  * {known.why}")
    _print(f"  * {example.unknown}")


def confronted(example: Example, effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what is known with the effects that say it, as ``report.json`` names them: by name, or
    as what cannot be told from one.
    """
    rows = []
    for known in example.known:
        named = [
            str(effect["name"])
            for effect in effects
            if {effect["name"], *effect["indistinguishable_from"]} & set(known.effects)
        ]
        rows.append({"known": known.why, "effects": list(known.effects), "named": named})
    return rows


def conclude(example: Example, effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Say what of the known was found, and what else was named; return the former."""
    rows = confronted(example, effects)
    for row in rows:
        found = f"found, as {' and '.join(row['named'])}" if row["named"] else "not found"
        _print(f"{' or '.join(row['effects'])}: known, and {found}.")
    known = {name for row in rows for name in row["named"]}
    others = [effect["name"] for effect in effects if effect["name"] not in known]
    if others:
        _print(f"Also named, and nobody knows whether it is so: {', '.join(others)}.")
    return rows
