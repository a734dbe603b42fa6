"""A page of every command and its options, made when the site is built, from the commands
themselves.
"""

import re
from typing import Any

import typer
from mkdocs.structure.files import File, Files
from typer.cli import get_docs_for_click

from windwrench.cli import app


def on_files(files: Files, config: Any) -> Files:
    """Add ``commands.md``."""
    group = typer.main.get_command(app)
    text = get_docs_for_click(
        obj=group, ctx=typer.Context(group), name="windwrench", title="Commands"
    )
    files.append(File.generated(config, "commands.md", content=_with_a_table(text, group.commands)))
    return files


def _with_a_table(text: str, commands: Any) -> str:
    """Return the page with a table of whole sentences where Typer lists commands cut short."""
    rows = [
        f"| [`{name}`](#windwrench-{name}) | {_summary(command.help)} |"
        for name, command in commands.items()
        if not command.hidden
    ]
    table = "\n".join(["| command | what it does |", "| --- | --- |", *rows])
    before, mark, rest = text.partition("**Commands**:\n")
    return before + mark + "\n" + table + "\n\n" + re.sub(r"\A\s*(\* `.*\n)+", "", rest)


def _summary(help_text: str | None) -> str:
    """Return the first paragraph of a command's help as one line."""
    return " ".join((help_text or "").split("\n\n")[0].split()).replace("|", "\\|")
