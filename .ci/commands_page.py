"""Print the site's page of all commands and their options, from the commands themselves."""

import re
from typing import Any

import typer
from typer.cli import get_docs_for_click

from windwrench.cli import app


def page() -> str:
    """Return the page as Markdown, with a table of whole sentences where Typer cuts short."""
    group: Any = typer.main.get_command(app)
    text = get_docs_for_click(
        obj=group, ctx=typer.Context(group), name="windwrench", title="Commands"
    )
    rows = [
        f"| [`{name}`](#windwrench-{name}) | {_summary(command.help)} |"
        for name, command in group.commands.items()
        if not command.hidden
    ]
    table = "\n".join(["| command | what it does |", "| --- | --- |", *rows])
    before, mark, rest = text.partition("**Commands**:\n")
    return before + mark + "\n" + table + "\n\n" + re.sub(r"\A\s*(\* `.*\n)+", "", rest)


def _summary(help_text: str | None) -> str:
    """Return the first paragraph of a command's help as one line."""
    return " ".join((help_text or "").split("\n\n")[0].split()).replace("|", "\\|")


if __name__ == "__main__":
    print(page())
