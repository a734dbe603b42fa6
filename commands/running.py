"""How every command runs: ``--json``, ``--quiet`` and ``--dry-run`` mean the same everywhere;
``run.json`` records the run.
"""

import functools
import inspect
import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import typer

from .. import __version__
from ..runtime.page_files import write_text
from ..runtime.plain_values import plain
from ..runtime.provenance import package_versions
from ..runtime.threads import one_thread
from .options import check_values, declared
from .terminal import DryRun, command_line, console, errors, run

Work = TypeVar("Work", bound=Callable[..., Any])


def expensive(work: Work) -> Work:
    """Mark a command of minutes: ``--dry-run`` stops the command at ``results_folder``."""
    work.expensive = True  # type: ignore[attr-defined]
    return work


def as_command(work: Callable[..., Any]) -> Callable[..., None]:
    """Return a function for typer: ``work`` with the options of every command.

    ``work`` returns the result for ``--json``, gives ``say`` its written files, and
    ``results_folder`` their place.
    """
    name = command_name(work)
    can_stop = getattr(work, "expensive", False)

    @functools.wraps(work)
    def command(*, as_json: bool, quiet: bool, dry_run: bool = False, **options: Any) -> None:
        run.begin(dry_run)
        console.quiet, errors.quiet = as_json or quiet, quiet
        try:
            check_values(name, options)
            with one_thread():
                outcome: dict[str, Any] = {"result": work(**_grouped(signature, options))}
            if run.record is not None:
                write_run(run.record, name, options)
        except DryRun as stopped:
            outcome = {"dry_run": True, "would": stopped.plan, "out": stopped.out}
            console.print(f"{name} would do")
            for key, value in stopped.plan.items():
                if value is not None:
                    console.print(f"  {key}: {_words(value)}", soft_wrap=True)
            console.print(f"  and write to {stopped.out}", soft_wrap=True)
        except BaseException:
            run.undo()
            raise
        finally:
            console.quiet = errors.quiet = False
        if as_json:
            written = [*run.written, *([run.record] if run.record is not None else [])]
            print(
                json.dumps(plain({"command": name, **outcome, "written": written}), allow_nan=False)
            )
        if run.code:
            raise typer.Exit(run.code)

    signature = inspect.signature(work, eval_str=True)
    flags = ("as_json", "quiet", *(["dry_run"] if can_stop else []))
    given = [
        *(each for one in signature.parameters.values() for each in _single(one)),
        *(
            inspect.Parameter(flag, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=bool)
            for flag in flags
        ),
    ]
    kinds = {one.name: declared(name, one.name, one.annotation) for one in given}
    command.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[one.replace(annotation=kinds[one.name]) for one in given],
        return_annotation=None,
    )
    command.__annotations__ = kinds
    return command


def _single(one: inspect.Parameter) -> list[inspect.Parameter]:
    """Return the options of a group, a data class; else the one itself."""
    if not is_dataclass(one.annotation):
        return [one]
    each = fields(one.annotation)
    return [one.replace(name=f.name, default=f.default, annotation=f.type) for f in each]


def _grouped(signature: inspect.Signature, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a command from single options."""
    given = {}
    for name, one in signature.parameters.items():
        group: Callable[..., Any] = one.annotation
        each = {single.name: options[single.name] for single in _single(one)}
        given[name] = each[name] if name in each else group(**each)
    return given


def _words(value: object) -> str:
    """Return a part of a plan for a reader."""
    if isinstance(value, Mapping):
        return "; ".join(f"{key}: {_words(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value))
    return str(value)


def command_name(work: Callable[..., Any]) -> str:
    """Return the typed name of a function's command."""
    return work.__name__.replace("_", "-")


def write_run(path: Path, name: str, options: Mapping[str, Any]) -> None:
    """Write how the results beside a file came about, under the command's name: other commands'
    runs in it stay.

    It holds no date and no duration: the same command gives the same bytes.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        kept = {}
    entry = {
        "command": command_line(),
        "seed": options.get("seed"),
        "options": options,
        "windwrench": __version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": package_versions(),
    }
    runs = {**(kept if isinstance(kept, dict) else {}), name: plain(entry)}
    write_text(json.dumps(runs, indent=1, sort_keys=True, allow_nan=False) + "\n", path)
