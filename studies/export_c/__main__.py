"""``python -m studies.export_c``: the exported filter against Python and on a Cortex-M4F, and its
page.
"""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.commands.terminal import share_bars_by_part
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.regular_files import read_json
from windwrench.studies.export_c.compiled import missing
from windwrench.studies.export_c.firmware import TOOLS
from windwrench.studies.export_c.page import write_page
from windwrench.studies.export_c.study import run
from windwrench.studies.export_c.webassembly import tools_missing


def study(
    steps: Annotated[int, typer.Option(min=200, help="Of each of five flights.")] = 20_000,
    seed: Annotated[int, typer.Option(min=0, help="Of flights and faults.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("docs/export-c"),
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Write the page from results that lie there.")
    ] = False,
) -> None:
    """Compare the exported C filters with Python, and measure them on a Cortex-M4F (8 minutes)."""
    data = out / "results.json"
    if not page_only:
        if lacking := [*missing("gcc", *TOOLS), *tools_missing()]:
            raise InputError(
                f"not installed: {', '.join(lacking)}; expected gcc, Debian's "
                "gcc-arm-none-eabi, libnewlib-arm-none-eabi, qemu-system-arm, clang, lld and nodejs"
            )
        with share_bars_by_part() as report:
            write_json(run(steps, seed, report), data)
    write_page(read_json(data, "results of this study"), data, out.with_suffix(".md"))


if __name__ == "__main__":
    typer.run(study)
