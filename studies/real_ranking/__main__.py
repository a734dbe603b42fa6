"""``python -m studies.real_ranking`` fits, flies, and writes the tables of its page."""

import argparse
from pathlib import Path

import numpy as np

from windwrench.runtime.whole_files import replaced

from .published_log import control_gains
from .simulation import LAWS, PUBLISHED, SEEDS, WINDS, Assumed, fit, fly

_BEGIN, _END = "<!-- tables: begin -->\n", "<!-- tables: end -->"


def _cell(values: list[float]) -> str:
    some = np.array(values)
    lost = int(np.sum(~np.isfinite(some)))
    if lost:
        return f"{lost} of {len(some)} lost"
    half = 2.365 * some.std(ddof=1) / np.sqrt(len(some))  # t of 7 degrees of freedom
    return f"{some.mean():.3f} (±{half:.3f})"


def main() -> None:
    """Write the page's tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, default=Path("docs/real-ranking.md"))
    parser.add_argument("--log", type=Path, help="a published flight's table: print its gains")
    given = parser.parse_args()
    if given.log is not None:
        for axis, gains in zip("xz", control_gains(given.log), strict=True):
            print(f"{axis}: {gains}")
        return
    assumed = Assumed()
    cutoff = fit(PUBLISHED["INDI"][0], assumed)
    lines = [
        "| law | " + " | ".join(f"{w} m/s" for w in WINDS) + " |",
        "| - |" + " - |" * len(WINDS),
    ]
    means: dict[str, list[float]] = {}
    for law in LAWS:
        flown = [[fly(law, cutoff, w, k, assumed) for k in range(SEEDS)] for w in WINDS]
        means[law] = [float(np.mean(some)) for some in flown]
        cells = " | ".join(map(_cell, flown))
        lines.append(f"| {law}, simulated | {cells} |")
        print(lines[-1], flush=True)
        if law in PUBLISHED:
            cells = " | ".join(f"{x:.3f}" for x in PUBLISHED[law])
            lines.append(f"| {law}, published | {cells} |")
            off = [100.0 * (a / b - 1.0) for a, b in zip(means[law], PUBLISHED[law], strict=True)]
            lines.append(f"| {law}, off by | {' | '.join(f'{x:+.0f} %' for x in off)} |")
    right = [
        wind
        for i, wind in enumerate(WINDS)
        if (means["INDI"][i] < means["PD"][i]) == (PUBLISHED["INDI"][i] < PUBLISHED["PD"][i])
    ]
    inside = [
        f"{law} at {wind}"
        for law in PUBLISHED
        for i, wind in enumerate(WINDS)
        if abs(means[law][i] / PUBLISHED[law][i] - 1.0) <= 0.25
    ]
    text = (
        "\n".join(lines)
        + f"\n\nINDI's cut-off, fitted without wind: {cutoff:.2f} Hz. Order of PD and INDI as "
        f"published: in {len(right)} of {len(WINDS)} winds. "
        f"Within 25 %: {len(inside)} of {len(PUBLISHED) * len(WINDS)} ({', '.join(inside)}).\n"
    )
    print(text)
    page = given.page.read_text(encoding="utf-8")
    before, _, rest = page.partition(_BEGIN)
    with replaced(given.page) as partial:
        partial.write_text(
            before + _BEGIN + "\n" + text + "\n" + _END + rest.partition(_END)[2], encoding="utf-8"
        )


if __name__ == "__main__":
    main()
