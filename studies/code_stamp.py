"""A digest of the code that made a result: results of other code are not comparable, and not
reused.
"""

import hashlib
from functools import cache
from pathlib import Path

_ROOMS = ("runtime", "dynamics", "estimator", "controllers", "identification", "envs")


@cache
def code_stamp(*modules: str) -> str:
    """Return a digest (16 hexadecimal digits) of all rooms that fly and diagnose, and of these
    modules of the studies.

    Args:
        modules: paths below this folder without their ending, such as ``trials/outsiders``.
    """
    root = Path(__file__).resolve().parent.parent
    files = [root / "studies" / f"{name}.py" for name in modules]
    files += [
        path
        for room in _ROOMS
        for path in (root / room).rglob("*")
        if path.suffix in (".py", ".yaml", ".xml")
    ]
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
