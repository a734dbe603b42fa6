"""The paper, figure by figure."""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .running import expensive
from .terminal import console, results_folder, say, working


@expensive
def reproduce(
    figure: str = "all",
    out: Path = Path("results/reproduction"),
    seeds: int | None = None,
    jobs: int | None = None,
    page: Path | None = None,
) -> dict[str, Any]:
    """Reproduce the paper's figures. A repeated command resumes and keeps finished figures.

    Each figure gives NAME.json (figures of merit), NAME.csv.gz (data), NAME.png and NAME.svg.

    Example: windwrench reproduce fig6 --out results/reproduction
    """
    from ..runtime.errors import InputError

    if find_spec("..reproduction", __package__) is None:
        raise InputError(
            "reproduce: the installed wheel holds no figures; run in a checkout: pip install -e "
            "'.[reproduction]'"
        )
    from ..reproduction import NAMES
    from ..reproduction.reproduce import chosen, is_done, numbers_of_seeds, write_page
    from ..reproduction.reproduce import reproduce as run
    from ..runtime.regular_files import read_json

    names = chosen(figure)
    numbers = numbers_of_seeds(names, seeds)
    folder = results_folder(
        out,
        seeds={name: n for name, n in numbers.items() if not is_done(out, name, n)},
        kept=[name for name, n in numbers.items() if is_done(out, name, n)],
        jobs=jobs,
    )
    with working("figures") as progress:

        def report(shares: Mapping[str, float]) -> None:
            left = ", ".join(name for name, share in shares.items() if share < 1.0)
            progress(sum(shares.values()) / len(names), f"figures: {left}")

        fresh = run(names, folder, seeds, jobs, report)
    target = folder / "reproduction.md" if page is None else page
    write_page(NAMES, folder, target)
    result: dict[str, Any] = {}
    for name in names:
        kept = read_json(folder / f"{name}.json", "a figure's results")
        result[name] = {key: kept[key] for key in ("title", "figures", "comparison")}
        result[name]["kept"] = not fresh[name]
        console.print(
            f"\n{kept['title']}" + ("" if fresh[name] else " (finished in an earlier run)"),
            style="bold",
        )
        for row in kept["comparison"]:
            paper = f"; the paper: {row['paper']}" if row["paper"] != "-" else ""
            console.print(f"  {row['quantity']}: {row['here']}{paper}")
    say(*(folder / f"{name}.png" for name in names), target)
    return result
