"""``python -m evidence.trust`` makes the page "How far to trust it" anew.

The studies of the page run in order, each as its own command, and keep their results. A study is
left out where no code that it measures has changed since its kept result was made. So a run that is
interrupted goes on where it stopped.
"""

import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from windwrench.evidence.kept_results import DOCS, ROOT, kept
from windwrench.evidence.measured_flights import PARTS
from windwrench.evidence.pages import page_of_results
from windwrench.evidence.runner import ROOMS, start
from windwrench.evidence.trust_page import RESULTS
from windwrench.runtime.errors import unknown_name
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import git

SHARED = "evidence/trials", "evidence/fan_wall.py"  # by several studies


class Study(NamedTuple):
    """How a study of the page is run.

    Attributes:
        module: below this folder.
        options: of its command; ``{data}`` stands for the data folder.
        needs: folder below the data folder without which it cannot run; "" if none.
        minutes: on one core.
    """

    module: str
    options: str
    needs: str
    minutes: float


STUDIES: Mapping[str, Study] = {
    **{
        part: Study("measured_flights", f"--part {part} --data {{data}}", folder, 2.0)
        for part, (folder, _) in PARTS.items()
    },
    "nanodrone": Study("nanodrone_benchmark", "--data {data}/idsia --runs 1", "idsia", 7.0),
    "published": Study(
        "published",
        "--racer {data}/racer --imu {data}/crazyflie_imu --crazyflies {data}/crazyflies",
        "racer",
        7.0,
    ),
    "unseen_flights": Study("unseen_flights", "--data {data}", "nanobench", 8.0),
    "simulated_vehicles": Study("simulated_vehicles", "", "", 4.0),
    "other_engines": Study("other_engines", "", "", 1.0),
    "probabilities": Study(
        "probabilities", "--simulator {data}/../generator/make_flights.py", "../generator", 6.0
    ),
    "perfect_models": Study(
        "perfect_models", "--simulator {data}/../generator/make_flights.py", "../generator", 120.0
    ),
    "recovery": Study("recovery", "", "", 4.0),
}


def is_current(name: str) -> bool:
    """Return whether no code that a study measures differs from the code of its kept result."""
    path = RESULTS[name]
    if not (DOCS / path).exists():
        return False
    code = *ROOMS, *SHARED, f"evidence/{STUDIES[name].module}*"
    try:
        git(ROOT, "diff", "--quiet", str(kept(path)["commit"]), "--", *code)
    except subprocess.SubprocessError:
        return False
    return True


def study(
    only: Annotated[
        list[str] | None, typer.Option(help="Name of a study, once for each; default: all.")
    ] = None,
    data: Annotated[Path, typer.Option(help="Folder of the studies' flights.")] = Path(
        "../shared/data"
    ),
) -> None:
    """Run the studies that are not of the code of today, and write the page."""
    for name in only or ():
        if name not in STUDIES:
            raise unknown_name("study", name, STUDIES)
    pending = []
    for name in only or STUDIES:
        one = STUDIES[name]
        if is_current(name):
            print(f"{name}: kept result is of this code")
        elif not (data / one.needs).exists():
            print(f"{name}: no folder {data / one.needs}; kept result stays")
        else:
            pending.append(one)
    for i, one in enumerate(pending):
        hours = sum(x.minutes for x in pending[i:]) / 60.0
        print(f"{i} of {len(pending)} done, {hours:.1f} h of one core left", flush=True)
        began = time.monotonic()
        words = ["-m", f"windwrench.evidence.{one.module}"]
        words += one.options.format(data=data.resolve()).split()
        print("python", *words, flush=True)
        status = subprocess.run([sys.executable, *words], cwd=ROOT, check=False).returncode
        ended = "done" if status == 0 else f"failed with status {status}; its kept result stays"
        print(f"{ended}, {(time.monotonic() - began) / 60.0:.1f} min", flush=True)
    write_text(page_of_results("trust"), DOCS / "trust.md")


if __name__ == "__main__":
    start(study)
