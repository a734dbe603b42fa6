"""What the names of a table's columns say: which belong together, what they are of, and their
unit.

Names are read as people write them: ``pos_x``, ``Position.X [mm]``, ``qw``, ``q[0]``,
``gyroADC[1]``, ``roll_deg``, ``motor[3]``, ``rpm_front_left``.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

# a unit, and how it is written in brackets, at the end of a name, or in a line of units
_SPELLINGS = {
    "s": "s sec seconds",
    "ms": "ms msec",
    "us": "us usec µs",
    "ns": "ns nsec",
    "m": "m",
    "mm": "mm",
    "cm": "cm",
    "deg": "deg degrees °",
    "rad": "rad radians",
    "rad/s": "rad/s radps rads rad_s",
    "deg/s": "deg/s °/s degps dps deg_s",
    "m/s2": "m/s2 m/s^2 m/s² mps2 ms2 m_s2",
    "g": "g",
    "rpm": "rpm",
    "eRPM": "erpm",
    "Hz": "hz",
    "V": "v",
    "mV": "mv",
    "cV": "cv",
    "percent": "% percent",
}
_UNITS = {word: unit for unit, words in _SPELLINGS.items() for word in words.split()}
_OTHER_UNITS = ("", "-", "1", "m/s", "n", "nm")  # of columns that no map uses
_BRACKETS = re.compile(r"\s*[\[(]\s*([^\[\]()\d][^\[\]()]*?)\s*[\])]\s*$")
_ENDING = re.compile(
    rf"[_ ]({'|'.join(word for word in _UNITS if re.fullmatch('[a-z0-9_]+', word))})$",
    re.IGNORECASE,
)

# endings of the names of rotors at the front left, rear left, rear right and front right
PLACES = [
    (front + gap + left, rear + gap + left, rear + gap + right, front + gap + right)
    for front, rear, gap, left, right in (
        ("front", "rear", "_", "left", "right"),
        ("front", "back", "_", "left", "right"),
        ("front", "rear", "", "left", "right"),
        ("front", "back", "", "left", "right"),
        ("f", "r", "", "l", "r"),
        ("f", "b", "", "l", "r"),
    )
]
_NOT_MEASURED = re.compile(r"(^|_)(set|sp|setpoint|target|des|desired|ref|goal)(_|$)|setpoint")


@dataclass(frozen=True)
class Name:
    """A column's name, taken apart."""

    column: str
    base: str  # lower case, without its unit, words joined by underscores
    unit: str = ""


@dataclass(frozen=True)
class Group:
    """Columns that belong together."""

    columns: tuple[str, ...]
    key: str  # what their names share
    unit: str = ""
    numbered: bool = False  # by numbers, not by axes


def take_apart(header: Sequence[str], units: Sequence[str] = ()) -> list[Name]:
    """Return the columns' names, taken apart; ``units`` are those of a line behind the header."""
    out = []
    for i, column in enumerate(header):
        text, unit = column.strip(), ""
        found = _BRACKETS.search(text) or _ENDING.search(text)
        if found and found.start() > 0:
            unit = _UNITS.get(found[1].lower(), "")
            text = text[: found.start()]
        if not unit and i < len(units):
            unit = _UNITS.get(_bare(units[i]), "")
        base = re.sub(r"[^0-9a-zA-Z]+", "_", text).strip("_").lower()
        out.append(Name(column, base or column.lower(), unit))
    return out


def is_unit(text: str) -> bool:
    """Return whether a field is a unit, as one stands in a line of units."""
    return _bare(text) in _UNITS or _bare(text) in _OTHER_UNITS


def _bare(text: str) -> str:
    return text.strip(" []()").lower()


def groups_of(names: Iterable[Name], endings: Sequence[str], numbered: bool = False) -> list[Group]:
    """Return the groups of columns whose names differ in one of ``endings`` alone, at the end or at
    the beginning, in the order of the endings.
    """
    found: dict[tuple[str, bool], dict[str, Name]] = {}
    for name in names:
        for ending in endings:
            for key, behind in (
                (name.base.removesuffix(ending), True),
                (name.base.removeprefix(ending), False),
            ):
                if key == name.base or key == "_" or (not behind and key[:1] not in ("_", "")):
                    continue
                if key[-1:].isdigit() and behind and numbered:
                    continue
                found.setdefault((key.strip("_"), behind), {}).setdefault(ending, name)
    out = []
    for (key, _), members in found.items():
        if len(members) == len(endings):
            named = [members[ending] for ending in endings]
            units = {name.unit for name in named}
            unit = units.pop() if len(units) == 1 else ""
            group = Group(tuple(name.column for name in named), key, unit, numbered)
            if group not in out:
                out.append(group)
    return [group for group in out if not _NOT_MEASURED.search(group.key)]


def best_group(groups: Iterable[Group], words: Sequence[str]) -> tuple[Group | None, int]:
    """Return the group whose key fits the first of ``words`` (regular expressions of a whole key)
    that any fits, and how many fit at all.
    """
    groups = list(groups)
    fitting = [
        (i, group)
        for group in groups
        for i, word in enumerate(words)
        if re.fullmatch(word, group.key)
    ]
    if not fitting:
        return None, 0
    best = min(fitting, key=lambda item: item[0])
    return best[1], len({group.columns for _, group in fitting})
