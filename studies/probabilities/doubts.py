"""What each check that makes names tentative is worth: on how many flights with a wrong name it
speaks, on how many as the only one, and on how many with right names alone.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from windwrench.studies.page_tables import table
from windwrench.studies.probabilities.fitting import is_right

# a sign of structure by the words in which it is said: its test, or where it is
_SIGNS = (
    ("block to the next", "structure: a coefficient differs from block to block"),
    ("another power of speed", "structure: a drag grows with another power of speed"),
    ("it changes below", "structure: a mass or an offset differs in slow motion"),
    ("channels do not agree", "structure: channels do not agree on a coefficient"),
    ("is not constant", "structure: a coefficient changes with a variable"),
    ("innovations confirm", "structure: innovations confirm what the residual hardly shows"),
    ("rotor thrust beyond", "structure: thrust bends"),
    ("bends at one point", "structure: thrust bends"),
    ("position and heading together", "structure: drag by place"),
    ("a candidate regressor", "structure: a candidate regressor"),
)


def checks_of(flight: Mapping[str, Any]) -> set[str]:
    """Return the checks that doubt the names of a recorded flight."""
    signs = {
        next(name for words, name in _SIGNS if words in f"{test} {where}")
        for test, where, _ in flight["signs"]
    }
    return signs | set(flight["doubts"])


def table_of_doubts(flights: Sequence[Mapping[str, Any]]) -> str:
    """Return the checks, those that save most flights alone first, as a Markdown table."""
    count: dict[str, Counter[str]] = {}
    for flight in flights:
        if not flight["named"]:
            continue
        wrong = not all(is_right(dict(flight), e["name"]) for e in flight["named"])
        speaking = checks_of(flight)
        for check in speaking:
            own = count.setdefault(check, Counter())
            own["wrong" if wrong else "right"] += 1
            if len(speaking) == 1:
                own["wrong, alone" if wrong else "right, alone"] += 1
    order = sorted(count, key=lambda x: (-count[x]["wrong, alone"], -count[x]["wrong"], x))
    kinds = ("wrong", "wrong, alone", "right", "right, alone")
    return table(
        [
            "check",
            "flights with a wrong name",
            "... it alone",
            "flights with right names only",
            "... it alone",
        ],
        [[check, *(str(count[check][kind]) for kind in kinds)] for check in order],
    )
