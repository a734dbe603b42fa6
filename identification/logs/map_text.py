"""A guessed map as a YAML file, with comments on certain fields, guesses and choices."""

import yaml

from .log_map import UNKNOWN, Battery, Columns, Commands, Rotors
from .map_guess import Guess
from .table import Data
from .what_flew import order_names


def map_yaml(guess: Guess) -> str:
    """Return a guessed map as a YAML file; comments mark certain fields and guesses, and list the
    columns to choose from for each ``?``.
    """
    m = guess.log_map
    time = {name: getattr(m.time, name) for name in ("column", "unit", "nanoseconds")}
    sections: Data = {
        "vehicle": m.vehicle,
        "time": {name: value for name, value in time.items() if value and m.time.column},
        "world": m.world,
        "body": m.body,
        **{name: _fields(part) for name, part in m.sections.items()},
    }
    sections = {name: value for name, value in sections.items() if value}
    lines = ["# A map of this table's columns. What is marked GUESS: check it."]
    if guess.missing:
        lines.append(f"# {UNKNOWN}: choose, and write it here. Still missing: {guess.lacks}")
    for lack in guess.missing:
        several = [UNKNOWN] * (4 if lack.section in ("attitude", "rotors") else 3)
        sections[lack.section] = {lack.field: several if lack.field == "columns" else UNKNOWN}
    for name, value in sections.items():
        lines += [
            f"# {'certain' if r.certain else 'GUESS'}: {f'{r.field}: ' if r.field else ''}{r.why}"
            for r in guess.reasons
            if r.section == name
        ]
        lines += [
            f"# choose {name}.{lack.field}: {'; '.join(lack.candidates) or 'columns of the table'}"
            for lack in guess.missing
            if lack.section == name
        ]
        text = yaml.safe_dump(
            {name: value},
            default_flow_style=False if isinstance(value, str) else None,
            sort_keys=False,
            width=1000,
            allow_unicode=True,
        )
        lines.append(text.rstrip())
    if guess.unused:
        lines.append(f"# columns that are not used: {', '.join(guess.unused)}")
    return "\n".join(lines) + "\n"


def _fields(part: Columns) -> Data:
    """Return a section's fields for the file, without defaults."""
    fields = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in vars(part).items()
        if value not in ("", (), None, False, 1, (0.0, 1.0))
    }
    if isinstance(part, Battery):
        fields = {"column": fields.pop("columns")[0], **fields}
    if isinstance(part, Rotors | Commands):
        fields["order"] = [*order_names(part.order), fields["order"]][0]
    if fields.get("euler"):
        del fields["order"]  # a quaternion's
    return fields
