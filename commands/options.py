"""The options and arguments of the commands. ``options.yaml`` explains each; a command's function
states its name, type and default.
"""

import os
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.errors import InputError, unknown_name
from ..runtime.regular_files import check_regular
from ..runtime.yaml_file import read_yaml

_OPTIONS: dict[str, Any] = read_yaml(Path(__file__).with_name("options.yaml"), "options")


def _described(command: str, name: str) -> dict[str, Any]:
    """Return the entry of an option in ``options.yaml``: the command's own words before the common
    ones.
    """
    entry: dict[str, Any] = {}
    for section in ("common", command):
        said = _OPTIONS.get(section, {}).get(name, {})
        entry |= {"help": said} if isinstance(said, str) else said
    return entry


def declared(command: str, name: str, kind: Any) -> Any:
    """Return the type of a command's parameter with its declaration for typer."""
    said = _described(command, name)
    sources = said.pop("names", None)
    for key in ("only", "reads"):  # checked when the command runs
        said.pop(key, None)
    if sources is not None:
        said["autocompletion"] = offering(sources)
    if said.pop("argument", False):
        return Annotated[kind, typer.Argument(**said)]
    flags = said.pop("flags", [f"--{name.replace('_', '-')}"])
    return Annotated[kind, typer.Option(*flags, **said)]


def check_values(command: str, options: Mapping[str, Any]) -> None:
    """Check the options with a closed list of names, and the files read by a command: a wrong path
    is told before anything large is imported.

    Raises:
        InputError: an option has another value, or a file is not there.
    """
    for name, value in options.items():
        said = _described(command, name)
        if said.get("only") and value is not None and value not in names_of(said["names"]):
            raise unknown_name(name, value, names_of(said["names"]))
        if "reads" in said:
            for path in value if isinstance(value, list) else [value] if value else []:
                if not os.path.exists(path):
                    check_regular(path, said["reads"])  # says why


def names_of(sources: str | list[str]) -> list[str]:
    """Return the names offered by an option.

    Args:
        sources: names, or ``module:attribute`` within the package: a collection of names, or a
            function without arguments for one.
    """
    names: list[str] = []
    for source in [sources] if isinstance(sources, str) else sources:
        module, colon, attribute = source.partition(":")
        if colon:
            offered = getattr(import_module(f"..{module}", __package__), attribute)
            names += offered() if callable(offered) else offered
        else:
            names.append(source)
    return names


def offering(sources: str | list[str]) -> Callable[[str], list[str]]:
    """Return the completion of a name, or of the last of several with commas, in a shell. A module
    of ``sources`` (``names_of``) is imported there alone.
    """

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{name}" for name in names_of(sources) if name.startswith(last)]

    return complete


def listed(text: str, option: str) -> list[str]:
    """Return the different names in a text with commas, in its order.

    Raises:
        InputError: there is none.
    """
    names = [part.strip() for part in text.split(",") if part.strip()]
    if not names:
        raise InputError(f"{option}: expected names with commas between them, got {text!r}")
    return list(dict.fromkeys(names))
