"""Groups, parts and units of a table's columns, by their names.

Names are read as people write them: ``pos_x``, ``Position.X [mm]``, ``qw``, ``q[0]``,
``gyroADC[1]``, ``roll_deg``, ``motor[3]``, ``rpm_front_left``.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...runtime.yaml_file import read_yaml
from .table import Data, NamedTexts, Names, Texts

WORDS: Data = read_yaml(Path(__file__).with_name("column_words.yaml"), "words")
# by spelling; nothing for a unit without use in maps
_UNITS: NamedTexts = {
    word: unit for unit, spellings in WORDS["units"].items() for word in spellings
}
_PLAIN = "|".join(word for word in _UNITS if _UNITS[word] and re.fullmatch(r"\w+", word, re.A))
_ENDING = re.compile(rf"[_ ]({_PLAIN})$", re.IGNORECASE)
_BRACKETS = re.compile(r"\s*[\[(]\s*([^\[\]()\d][^\[\]()]*?)\s*[\])]\s*$")


@dataclass(frozen=True)
class Name:
    """A column's name, taken apart."""

    column: str
    base: str  # lower case, without its unit, words joined by underscores
    unit: str = ""


def unit_spelled(text: str) -> str:
    """Return the unit of a spelling, or nothing."""
    return _UNITS.get(text, "") or str(WORDS["unit_words"].get(text, ""))


@dataclass(frozen=True)
class Group:
    """Columns of one vector or of one set of motors."""

    columns: Names
    key: str = ""  # the common part of the names
    unit: str = ""
    endings: Names = ()  # axes or numbers in the names, where known

    @property
    def numbered(self) -> bool:
        """Whether the names say no axes."""
        return not self.endings or self.endings[0].isdigit()


def take_apart(header: Texts, units: Texts = ()) -> list[Name]:
    """Return the columns' names, taken apart; ``units`` stand in a line behind the header."""
    out = []
    for i, column in enumerate(header):
        text, unit = column.strip(), ""
        ending = _BRACKETS.search(text) or _ENDING.search(text)
        if ending and ending.start() > 0:
            unit = _UNITS.get(ending[1].lower(), "")
            text = text[: ending.start()]
        if not unit and i < len(units):
            unit = _UNITS.get(_bare(units[i]), "")
        base = re.sub(r"[^0-9a-zA-Z]+", "_", text).strip("_").lower()
        base = re.sub(r"(?<!\d)0+(\d)$", r"\1", base)  # q.00 is q.0
        out.append(Name(column, base or column.lower(), unit))
    return out


def is_unit(text: str) -> bool:
    """Return whether a field is a unit, as one stands in a line of units."""
    return _bare(text) in _UNITS


def _bare(text: str) -> str:
    return text.strip(" []()").lower()


def groups_of(names: Sequence[Name], endings: Texts) -> list[Group]:
    """Return the groups of columns whose names differ in one of ``endings`` alone, in the order of
    the endings. An ending stands at the end, at the beginning, or between other words.
    """
    families: dict[tuple[str, bool], dict[str, Name]] = {}
    bases = {name.base for name in names}
    numbered = endings[0].isdigit()
    before = "(?<!\\d)" if numbered else "_"
    for name in names:
        base = name.base
        for ending in endings:
            for key, behind in (
                (base.removesuffix(ending), True),
                (base.removeprefix(ending), False),
                (re.sub(rf"{before}{ending}_(?=.)", "_", base, count=1), True),
            ):
                if key in (base, "_") or (not behind and key[:1] not in ("_", "")):
                    continue
                if key[-1:].isdigit() and behind and numbered:
                    continue
                families.setdefault((key.strip("_"), behind), {}).setdefault(ending, name)
    unwanted = WORDS["not_measured"] + ("" if numbered else f"|{WORDS['sticks']}")
    more = "3" if endings[-1] == "2" else "0" if endings[0] == "1" else ""
    out = []
    for (key, _), members in families.items():
        if more and {key + more, f"{key}_{more}"} & bases:
            continue  # three of four, or four of five
        if len(members) == len(endings) and not re.search(unwanted, key):
            columns = tuple(members[ending].column for ending in endings)
            units = {name.unit for name in members.values()}
            unit = units.pop() if len(units) == 1 else ""
            out.append(Group(columns, key, unit, tuple(endings)))
    return list(dict.fromkeys(out))


def named_alone(names: Sequence[Name], part: str) -> list[Name]:
    """Return the likely names of a part of one column, the likeliest first: the time, or the
    battery's voltage.
    """
    known = WORDS[part]
    tails = [word if len(word) > 3 else f"_{word}" for word in known]
    return [
        *(name for word in known for name in names if name.base == word),
        *(name for tail in tails for name in names if name.base.endswith(tail)),
    ]
