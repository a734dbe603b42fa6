"""The page of the study."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def write_page(result: Mapping[str, Any], folder: Path, page: Path) -> None:
    """Write the page."""
