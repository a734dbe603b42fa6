"""A page of every command and its options, made when the site is built, from the commands
themselves.
"""

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
    files.append(File.generated(config, "commands.md", content=text))
    return files
