"""``python -m studies.motor_lag LOG:FROM-TO ...``: prints the table of each log."""

from typing import Annotated

import typer

from windwrench.commands.identifying import parse_window
from windwrench.studies.motor_lag.study import of_log
from windwrench.studies.page_tables import table

HEAD = ("model, thrust alone", "lag, 95 %", "time offset, 95 %", "left, rms")


def study(logs: Annotated[list[str], typer.Argument(help="LOG or LOG:FROM-TO, in s.")]) -> None:
    """Say what lag of the motors the thrust of logs shows, under four models."""
    for text in logs:
        path, (begin, end) = parse_window(text)
        typer.echo(f"{text}\n\n{table(HEAD, of_log(path, begin, end))}\n")


if __name__ == "__main__":
    typer.run(study)
