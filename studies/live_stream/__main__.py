"""``python -m studies.live_stream``: a day of a stream, one with faults, and the latency.

Writes ``docs/live/live-stream.json``. ``--hours H --rate HZ`` for other lengths; ``--only long``,
``rates``, ``faults`` or ``latency`` does one part again and keeps the others.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

from windwrench.runtime.page_files import write_json
from windwrench.studies.live_stream.latency import measure
from windwrench.studies.live_stream.long_stream import Faults, run_long

RESULT = Path("docs/live/live-stream.json")
RATES = ((4.0, 100.0), (2.0, 200.0))  # hours and Hz, as vehicles fly
FAULTS = Faults(lost=0.01, doubled=0.01, late=0.02, silences=4.0)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--rate", type=float, default=5.0)
    parser.add_argument("--only", choices=("long", "rates", "faults", "latency"))
    parser.add_argument("--out", type=Path, default=RESULT)
    given = parser.parse_args()
    found: dict[str, Any] = {}
    if given.out.exists():
        found = json.loads(given.out.read_text(encoding="utf-8"))

    def wanted(part: str) -> bool:
        return given.only in (None, part)

    def report(share: float) -> None:
        print(f"{100.0 * share:.0f} %", flush=True)

    if wanted("latency"):
        found["latency"] = [
            measure(),
            measure(view=True, record=True),
        ]
    if wanted("faults"):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "flight.csv"
            found["faults"] = run_long(given.hours / 24.0, 200.0, FAULTS, log, report)
    if wanted("rates"):
        found["flight_rates"] = [run_long(*rate, Faults(), report=report) for rate in RATES]
    if wanted("long"):
        found["long"] = run_long(given.hours, given.rate, Faults(), report=report)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    write_json(found, given.out)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
