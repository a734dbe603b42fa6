"""The trained policies that come with the kit, by their names: ``sac-0``, ``sac-fast-1``, ..."""

from functools import cache
from importlib import resources
from pathlib import Path


@cache
def shipped_policies(task: str = "FanTracking") -> dict[str, Path]:
    """Return the file of each policy of a task that this installation has, sorted by name. A wheel
    has one seed of each of ``FanTracking`` alone, a checkout all.
    """
    folder = Path(str(resources.files(__package__))).parent / "training" / "policies"
    start = "" if task == "FanTracking" else f"{task}-"
    found = (folder / "tasks" if start else folder).glob(f"{start}*.npz")
    kept = (path for path in found if path.with_suffix(".json").exists())
    return {path.stem.removeprefix(start): path for path in sorted(kept)}
