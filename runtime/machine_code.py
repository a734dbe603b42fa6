"""The place of machine code: a folder named by a digest of all its sources.

Numba keeps a function's machine code until the function's own file changes. The code also holds
called functions and constants of other modules.
"""

import hashlib
import inspect
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import config

from .code_digest import code_digest
from .compile_notice import notice

_ROOT = Path(__file__).resolve().parent.parent
# all rooms with compiled functions, and all rooms imported there
ROOMS = (
    "runtime",
    "dynamics",
    "estimator",
    "controllers",
    "envs",
    "identification",
    "reproduction",
)
_PREFIX = "windwrench-"
_STARTED = time.time_ns()
# our files changed since then and before their import: the digest is of the older text
_edited: list[Path] = []
_KEPT = 8  # folders, the last used; one takes up to 30 MB
_IN_USE = 3600.0  # s after its last use, a folder stays in any case


@contextmanager
def code_folder(function: Callable[..., Any]) -> Iterator[bool]:
    """Have Numba keep the machine code of ``function`` beside code of the same sources. Yields
    whether there is a place.
    """
    folder = _folder_for(inspect.getfile(function))
    before = config.CACHE_DIR
    if folder is not None:
        config.CACHE_DIR = folder
    try:
        yield folder is not None
    finally:
        config.CACHE_DIR = before


def _folder_for(file: str) -> str | None:
    """Return the folder for machine code of a file's functions, or None where none can be kept."""
    is_ours, parent = _is_ours(file), _parent()
    # a prompt and a notebook have no file
    if parent is None or _edited or not os.path.isfile(file):
        return None
    folder = _prepared(parent, code_digest(ROOMS))
    return folder if is_ours else _prepared(folder, _digest_beside(file))


@cache
def _is_ours(file: str) -> bool:
    path = Path(file).resolve()
    is_ours = any(path.is_relative_to(_ROOT / room) for room in ROOMS)
    if is_ours and path.stat().st_ctime_ns > _STARTED:
        _edited.append(path)
    return is_ours


def _digest_beside(file: str) -> str:
    """Return a digest of the Python files of a folder, a user's own."""
    digest = hashlib.sha256()
    for path in sorted(Path(file).parent.glob("*.py")):
        with suppress(OSError):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _prepared(parent: str, digest: str) -> str:
    """Return a folder for machine code, and remove the folders unused for longest."""
    folder = Path(parent, f"{_PREFIX}{digest}")
    with suppress(OSError):
        folder.mkdir(exist_ok=True)
        os.utime(folder)  # its last use
        used = {path: path.stat().st_mtime for path in folder.parent.glob(f"{_PREFIX}*")}
        for path in sorted(used, key=lambda path: used[path])[:-_KEPT]:
            if time.time() - used[path] > _IN_USE:
                shutil.rmtree(path, ignore_errors=True)
    return str(folder)


@cache
def _parent() -> str | None:
    """Return the first of some folders that can be written: the user's choice, beside the sources,
    the user's cache, a temporary one.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    chosen = [os.path.abspath(config.CACHE_DIR)] if config.CACHE_DIR else []
    for path in map(Path, (*chosen, _ROOT / "__pycache__", f"{home}/windwrench")):
        if path.is_absolute() and _is_writable(path):
            return str(path)
    with suppress(OSError):  # no temporary folder either
        path = Path(tempfile.gettempdir(), f"windwrench-{os.getuid()}")
        if _is_writable(path, 0o700) and _is_private(path):
            return str(path)
    notice.is_kept = False
    return None


def _is_writable(path: Path, mode: int = 0o777) -> bool:
    try:
        path.mkdir(mode, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=path).close()
    except OSError:
        return False
    return True


def _is_private(path: Path) -> bool:
    """Return whether nobody else can have put machine code there: all users may write beside it."""
    status = path.lstat()
    mine = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
    return mine and not status.st_mode & 0o022
