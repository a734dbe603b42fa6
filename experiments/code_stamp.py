"""A digest of the code that made a result: results of other code are not comparable, and not reused."""

import hashlib
from functools import cache
from pathlib import Path

_FLOORS = ("dynamics", "estimator", "controllers", "identification", "envs")


@cache
def code_stamp(*experiments: str) -> str:
    """Return a digest (16 hexadecimal digits) of all floors below the experiments, and of these files among them.

    Args:
        experiments: names of modules in this folder.
    """
    root = Path(__file__).resolve().parent.parent
    files = [root / "experiments" / f"{name}.py" for name in experiments]
    files += [path for floor in _FLOORS for path in (root / floor).rglob("*") if path.suffix in (".py", ".yaml", ".xml")]
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
