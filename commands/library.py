"""The effect library, listed."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Column, Table

from .terminal import console, say


def effects(
    markdown: Annotated[
        Path | None,
        typer.Option(help="Markdown file for the page of all effects, instead of the list."),
    ] = None,
) -> dict[str, Any]:
    """List the effect library. Names, kinds, coefficients, units and typical values.

    Example: windwrench effects --markdown docs/effects.md
    """
    from ..dynamics.effects import get, names

    if markdown is not None:
        from ..runtime.whole_files import replaced
        from .effect_page import effects_page

        with replaced(markdown) as partial:
            partial.write_text(effects_page(), encoding="utf-8")
        say(markdown)
        return {"effects": names()}
    name_column, coefficient_column = (
        Column("effect", no_wrap=True),
        Column("coefficient", no_wrap=True),
    )
    table = Table(
        name_column,
        "kind",
        coefficient_column,
        "unit",
        "typical, 0.45 / 0.03 kg",
        "meaning",
        box=box.SIMPLE_HEAD,
    )
    for name in names():
        one = get(name)
        for i, c in enumerate(one.coefficients):
            table.add_row(
                name if i == 0 else "",
                one.kind if i == 0 else "",
                c.name,
                c.unit,
                f"{c.typical[0]:g} / {c.typical[1]:g}",
                c.meaning,
                end_section=i + 1 == len(one.coefficients),
            )
    console.print(table)
    return {
        "effects": {
            name: {
                "kind": get(name).kind,
                "coefficients": {
                    c.name: {
                        "unit": c.unit,
                        "meaning": c.meaning,
                        "typical": c.typical,
                        "minimum": c.minimum,
                        "maximum": c.maximum,
                    }
                    for c in get(name).coefficients
                },
            }
            for name in names()
        }
    }
