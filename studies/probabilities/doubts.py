"""What each check that makes names tentative is worth: on how many flights with a wrong name it
speaks, on how many as the only one, and on how many with right names alone.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from windwrench.studies.page_tables import table
from windwrench.studies.probabilities.fitting import checks_of, is_right


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
