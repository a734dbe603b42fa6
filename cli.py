"""The ``windwrench`` command."""

import sys
from typing import Any

import typer

from .commands.comparing import benchmark, speed
from .commands.flying import fly, record
from .commands.library import effects
from .commands.logs import diagnose, estimate
from .commands.studies import close_loop, real_flights, reproduce, trials
from .commands.terminal import errors
from .dynamics.errors import InputError

app = typer.Typer(
    name="windwrench", no_args_is_help=True, add_completion=True, rich_markup_mode=None, pretty_exceptions_enable=False,
    help="A quadrotor that feels the wind: fly it in a fan's jet, benchmark controllers, estimate the wrench on a flight log.",
)
_UsageError: Any = typer.BadParameter.__base__  # an option or argument that typer cannot use

for command in (fly, benchmark, estimate, diagnose, record, reproduce, trials, speed, real_flights, effects, close_loop):
    app.command(command.__name__.replace("_", "-"))(command)


def main() -> None:
    """Run the command; a user's mistake ends in one clear line and exit code 2."""
    try:
        sys.exit(app(sys.argv[1:] or ["--help"], standalone_mode=False))
    except (InputError, _UsageError) as error:
        text = str(error) if isinstance(error, InputError) else error.format_message()
        errors.print(f"error: {text}", style="red", highlight=False, soft_wrap=True, markup=False)
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        errors.print("interrupted")
        sys.exit(130)
