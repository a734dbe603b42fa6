"""Print the lowest versions that pyproject.toml allows, as constraints for pip.

``python .ci/lowest.py > lowest.txt; pip install -c lowest.txt -e .``
"""

import re
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
extras = project["optional-dependencies"]
for requirement in [
    *project["dependencies"],
    *extras["parquet"],
    *extras["logs"],
    *extras["reproduction"],
]:
    found = re.fullmatch(r"([\w.-]+)(?:\[[\w,-]+\])?>=([\d.]+)", requirement)
    if found is None:
        raise SystemExit(f"pyproject.toml: {requirement}: expected NAME>=VERSION")
    print(f"{found[1]}=={found[2]}")
