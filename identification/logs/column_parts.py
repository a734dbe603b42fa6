"""Which columns of a table are which part of a flight: what their numbers obey counts for more than
their names, which may be anyone's.

A quaternion has length 1. An accelerometer reads gravity, 9.81 m/s2 or 1 g. The size of a gyro is
that of the attitude's rate, and the horizontal acceleration of a position follows the tilt, in
whatever frames; the rate of a position stands in the columns of a velocity. Rotors or commands are
four columns of one size that move together with the specific force. Columns whose names say nothing
are looked at by threes and fours that stand side by side.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .column_names import Group, Name, groups_of, named_alone, side_by_side, words
from .column_numbers import PARTS, Numbers
from .magnitudes import within
from .table import Table

_FOURS = (("1", "2", "3", "4"), ("0", "1", "2", "3"))
_TRIPLES = (("x", "y", "z"), ("roll", "pitch", "yaw"))  # of which no column is another group's


@dataclass(frozen=True, eq=False)
class Candidate:
    """Columns that may be a part of a flight."""

    group: Group
    score: float
    why: str

    def __str__(self) -> str:
        return f"[{', '.join(self.group.columns)}] ({self.why})"


def named_columns(names: Sequence[Name]) -> set[str]:
    """Return the columns whose names speak for a part."""
    groups = [
        group
        for ways in words()["parts"].values()
        for way in ways
        for endings in (*way.get("endings", ()), *way.get("numbered", ()))
        for group in groups_of(names, endings)
        if _is_named(group, "")
    ]
    alone = [name.column for part in ("time", "battery") for name in named_alone(names, part)]
    return {*alone, *(column for group in groups for column in group.columns)}


def find_parts(names: Sequence[Name], numbers: Numbers) -> dict[str, list[Candidate]]:
    """Return the candidates of each part, the likeliest first. The columns of the first belong to
    no later part.

    Args:
        names: of the columns, but the time's.
        numbers: of columns; those without are no part's.
    """
    names = [name for name in names if name.column in numbers.data]
    found: dict[str, list[Candidate]] = {}
    taken: set[str] = set()
    for part in ("attitude", "accelerometer", "gyro", "position", "motors", "commands"):
        if part == "motors":
            felt, placed = (
                found[p][0].group.columns if found[p] and found[p][0].score > 0.0 else ()
                for p in ("accelerometer", "position")
            )
            numbers.feel(felt, placed)
        free = [name for name in names if name.column not in taken]
        ranked = sorted(_candidates(part, free, numbers), key=lambda c: -c.score)
        seen: dict[tuple[str, ...], Candidate] = {}
        for candidate in ranked:
            seen.setdefault(candidate.group.columns, candidate)
        found[part] = list(seen.values())
        if found[part] and found[part][0].score > 0.0:
            first = found[part][0].group.columns
            taken |= set(first)
            if part == "attitude" and len(first) == 4:
                numbers.take_attitude(first)
    return found


def _candidates(part: str, names: Sequence[Name], numbers: Numbers) -> Iterator[Candidate]:
    """Yield the candidates of a part, with a score by their names and numbers."""
    named = {column for way in _TRIPLES for g in groups_of(names, way) for column in g.columns}
    fours = (group for ending in _FOURS for group in groups_of(names, ending))
    commanded = part == "motors" and any(_is_named(group, part) for group in fours)
    for number, way in enumerate(words()["parts"][part]):
        for kind in ("endings", "numbered"):
            for endings in way.get(kind, ()):
                for group in groups_of(names, endings):
                    i = _place_of(group.key, way["words"])
                    if i is None and (commanded or _is_named(group, part)):
                        continue
                    named |= set(group.columns)
                    if i is None:
                        yield from _judged(part, group, -1.0, "their names go together", numbers)
                        continue
                    by_name = PARTS.numbers - 0.3 * i - 0.5 * number
                    yield from _judged(part, group, by_name, "by the columns' names", numbers)
    width = 4 if part in ("attitude", "motors") else 3
    if part == "commands" or commanded:
        return
    loose = [name for name in names if name.column not in named and numbers.varies(name.column)]
    for group in side_by_side(loose, width):
        yield from (one for one in _judged(part, group, 0.0, "", numbers) if one.why)


def _is_named(group: Group, part: str) -> bool:
    """Return whether the names of a group speak for another part."""
    return any(
        _place_of(group.key, way["words"]) is not None
        for other, ways in words()["parts"].items()
        for way in ways
        if other != part
        and list(group.endings) in (*way.get("endings", ()), *way.get("numbered", ()))
    )


def _place_of(key: str, patterns: Sequence[str]) -> int | None:
    return next((i for i, word in enumerate(patterns) if re.fullmatch(word, key)), None)


def _judged(
    part: str, group: Group, score: float, why: str, numbers: Numbers
) -> Iterator[Candidate]:
    """Yield a group with its score, more where its numbers obey the part's physics; nothing where
    they contradict it.
    """
    columns = group.columns
    if not len(numbers.rows(columns)[0]):
        yield Candidate(group, score, why)
        return
    strengths: dict[str, float] = {}
    if part == "attitude" and len(columns) == 4:
        if not numbers.is_quaternion(columns):
            return
        strengths["their length is 1"] = 1.0
    elif part == "accelerometer":
        unit, strength = numbers.gravity_unit(columns)
        strengths[f"their size is gravity's, in {unit}"] = strength if unit else 0.0
    elif part == "gyro":
        unit, strength = numbers.gyro_unit(columns)
        strengths[f"they turn as the attitude does, in {unit}"] = strength if unit else 0.0
    elif part == "position":
        strengths["their rates stand in other columns"] = float(numbers.has_rate(columns))
        strengths["their acceleration follows the tilt"] = numbers.follows_tilt(columns)
    elif part in ("motors", "commands"):
        together = float(numbers.moves_together(columns))
        strengths["they move together with the specific force"] = together
    said = [*filter(None, [why]), *(words for words, strength in strengths.items() if strength)]
    yield Candidate(group, score + PARTS.numbers * sum(strengths.values()), "; ".join(said))


def further_rotors(columns: Sequence[str], table: Table) -> list[str]:
    """Return the columns that go on with the numbers of four motors' columns, and turn as they do:
    those of a vehicle of more rotors. An output that is not a motor's by name may be a servo's, and
    counts where it is a sum of the four: all are mixed of thrust, roll, pitch and yaw.

    Raises:
        InputError: the table cannot be read.
    """
    out = []
    for name in numbered_alike(columns, table.numeric or table.header):
        data = table.read([*columns, name])
        rows = np.column_stack(list(data.values()))
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows) < PARTS.fewest or np.ptp(rows[:, 4]) == 0.0:
            continue
        size = abs(float(np.median(rows[:, 4]) / max(np.median(np.abs(rows[:, :4])), 1e-12)))
        moves = rows - rows.mean(axis=0)
        left = np.linalg.lstsq(moves[:, :4], moves[:, 4])[1]
        share = float(left[0] / np.sum(moves[:, 4] ** 2)) if len(left) else 0.0
        is_motor = re.search(words()["motor_words"], name.lower())
        if (is_motor or share < PARTS.left) and within(size, PARTS.rotor_sizes):
            out.append(name)
    return out


def rotors_said(columns: Sequence[str], further: Sequence[str]) -> str:
    """Return in words that a vehicle has more than four rotors."""
    turning = [*columns, *further]
    return f"{len(turning)} rotors turn ({', '.join(turning)}); expected the four of a quadrotor"


def numbered_alike(columns: Sequence[str], others: Sequence[str]) -> list[str]:
    """Return which other columns differ from four in a number alone, the next ones up."""
    pattern = re.compile(r"\d+")
    for found in zip(*(pattern.finditer(name) for name in columns), strict=False):
        if len({match[0] for match in found}) != len(columns):
            continue
        first, name = found[0], columns[0]
        before, behind = name[: first.start()], name[first.end() :]
        last = max(int(match[0]) for match in found)
        following = (f"{before}{n:0{len(first[0])}d}{behind}" for n in range(last + 1, 16))
        run = []
        for other in following:
            if other not in others:
                break
            run.append(other)
        return run
    return []
