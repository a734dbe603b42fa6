"""The diagnosis of the measured flight that comes with the kit, beside what is known of it."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..identification.logs.example import Example
from .terminal import console


def introduce(example: Example) -> None:
    """Say what flew, and what is known of it."""
    console.print(f"{example.what} ({example.source})")
    console.print("Known before the diagnosis:")
    for why in (*(known.why for known in example.known), example.unknown):
        console.print(f"  * {why}")


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
        console.print(f"{' or '.join(row['effects'])}: known, and {found}.")
    known = {name for row in rows for name in row["named"]}
    others = [effect["name"] for effect in effects if effect["name"] not in known]
    if others:
        console.print(f"Also named, and nobody knows whether it is so: {', '.join(others)}.")
    return rows
