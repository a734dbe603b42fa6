"""The ``windwrench`` command."""

import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from . import __version__
from .commands.benchmarking import benchmark
from .commands.changes import LogsAgainstLogs, compare
from .commands.checking import check
from .commands.demo import demo
from .commands.diagnosing import diagnose
from .commands.estimating import estimate
from .commands.exporting import export_c
from .commands.flying import fly, record
from .commands.identifying import identify
from .commands.learning import train
from .commands.live import live
from .commands.looking import is_path, look
from .commands.output import prepare_output
from .commands.paper import reproduce
from .commands.profiling import profile
from .commands.running import as_command, command_name
from .commands.terminal import errors
from .runtime.errors import InputError, unknown_name
from .runtime.interrupts import INTERRUPTED, TERMINATED, forget, noted
from .runtime.printable import printable


class _Commands(TyperGroup):
    """Takes a log in place of a command, and names the nearest command where one is mistyped."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command named by the first argument, or ``look`` for a log."""
        name = args[0] if args else ""
        if name and not name.startswith("-") and name not in self.commands:
            if not is_path(name):
                raise unknown_name("command", name, set(self.commands) - {"look"})
            args = ["look", *args]
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="windwrench",
    cls=_Commands,
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Exit codes: 0 success; 1 internal error, with a traceback; 2 invalid option or input "
    "file, or output that cannot be written, with a one-line message; 130 interrupted; 143 "
    "terminated. NO_COLOR=1 disables colours.",
)
_UsageError: Any = typer.BadParameter.__base__  # an option or argument unfit for typer


def _version(wanted: bool) -> None:
    if wanted:
        print(f"windwrench {__version__}")
        raise typer.Exit


@app.callback()
def windwrench(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_version, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    """Estimate the external force and torque (the wrench) on a quadrotor, in flight or from a log.
    Name physical effects that the vehicle's model lacks. Fly, rank and train controllers in
    simulated wind.

    First step: "windwrench demo" does all of this but training, and writes one page.

    Your own log: windwrench flight.ulg checks the log, estimates the wrench and names missing
    effects, on one page.

    All options of a command: windwrench fly --help
    """


_COMMANDS: tuple[Callable[..., Any], ...] = (
    demo,
    fly,
    benchmark,
    check,
    estimate,
    diagnose,
    compare,
    live,
    identify,
    profile,
    export_c,
    record,
    reproduce,
    train,
)
# earlier names of commands' options: taken, and not shown
_EARLIER = {
    "live": {"view": "browser"},
}
app.command(command_name(look), hidden=True)(as_command(look))
for command in _COMMANDS:
    name = command_name(command)
    earlier = _EARLIER.get(name, {})
    app.command(
        name,
        cls=LogsAgainstLogs if command is compare else None,
        context_settings={
            "token_normalize_func": lambda word, earlier=earlier: earlier.get(word, word)
        },
    )(as_command(command))


def main() -> None:
    """Run the command; a user's mistake ends in one clear line and exit code 2."""
    prepare_output()
    with noted() as interrupted:
        try:
            code = app(sys.argv[1:] or ["--help"], standalone_mode=False)
            sys.stdout.flush()
        except (KeyboardInterrupt, typer.Abort):
            interrupted()
            code = INTERRUPTED
        except (InputError, _UsageError) as error:
            code = INTERRUPTED if interrupted() else _refused(error)
        except Exception:
            if not interrupted():
                raise
            code = INTERRUPTED
    if code in (INTERRUPTED, TERMINATED):
        forget()
        errors.print("interrupted" if code == INTERRUPTED else "terminated")
    sys.exit(code)


def _refused(error: Any) -> int:
    """Print the user's mistake; return the exit code."""
    text = str(error) if isinstance(error, InputError) else error.format_message()
    for one in getattr(error.__cause__, "errors", list)()[:1]:  # pydantic's, behind typer's
        text += f", got {one['input']!r}"
    # a parser's message may take several lines
    errors.print(
        f"error: {' '.join(printable(text).split())}",
        style="red",
        soft_wrap=True,
    )
    return 2
