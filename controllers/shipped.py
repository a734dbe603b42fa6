"""The trained policies that come with the kit, by their names: ``sac-0``, ``sac-fast-1``, ..."""

from functools import cache
from importlib import resources
from pathlib import Path


@cache
def shipped_policies() -> dict[str, Path]:
    """Return the file of each policy that this installation has, sorted by name. A wheel has two
    seeds of each, a checkout all.
    """
    folder = Path(str(resources.files(__package__))).parent / "training" / "policies"
    found = (path for path in folder.glob("*.npz") if path.with_suffix(".json").exists())
    return {path.stem: path for path in sorted(found)}
