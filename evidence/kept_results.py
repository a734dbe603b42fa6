"""Results that are kept below ``docs/`` with the pages that show them."""

import gzip
import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


def kept(name: str, folder: Path | None = None) -> Any:
    """Return what a results file (JSON, or JSON compressed by gzip) below ``docs/`` holds."""
    path = (folder or DOCS) / name
    data = path.read_bytes()
    return json.loads(gzip.decompress(data) if path.suffix == ".gz" else data)
