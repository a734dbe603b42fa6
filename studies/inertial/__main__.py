"""``python -m studies.inertial RESULT.json [RUNS]`` measures everything and writes it as JSON."""

import sys
from pathlib import Path

from windwrench.runtime.page_files import write_json
from windwrench.studies.inertial.study import run

if __name__ == "__main__":
    write_json(
        run(int(sys.argv[2]) if len(sys.argv) > 2 else 20, 0, lambda *_: None),
        Path(sys.argv[1]),
        allow_nan=True,  # a rise time that no tuning reaches
    )
