"""One line on standard error where compiling takes more than a moment, and words for a progress.

``runtime.compiled`` reports when Numba compiles. This module imports nothing heavy: a command can
silence the notice at its start.
"""

import math
import sys
import threading
import time

PATIENCE = 2.0  # s of compiling until the line
_PAUSE = 1.0  # s between two functions; the words stay meanwhile
_ONCE, _EACH = "compiling, once for this code", "compiling, at each start"
LINE = f"windwrench: {_ONCE}; later starts load it"
NOT_KEPT = f"windwrench: {_EACH}: found no folder to keep it; NUMBA_CACHE_DIR can name one"


class CompileNotice:
    """Prints the line once, where compiling takes longer than 2 s; counts functions."""

    def __init__(self, patience: float = PATIENCE) -> None:
        self.quiet = False
        self.is_kept = True  # machine code, on disk
        self._patience = patience
        self._depth = 0  # of nested compilations: a function compiles its callees
        self._timer: threading.Timer | None = None
        self._told = False
        self._functions = 0
        self._ended = -math.inf  # s, when the last one was compiled

    @property
    def words(self) -> str:
        """Words for a progress in place of its own text while functions are compiled, or ``""``."""
        if not self._depth and time.monotonic() - self._ended > _PAUSE:
            return ""
        return f"{_ONCE if self.is_kept else _EACH}: {self._functions} functions"

    def begin(self) -> None:
        """Note the begin of compiling a function."""
        self._depth += 1
        self._functions += 1
        if self._timer is None and not self._told:
            self._timer = threading.Timer(self._patience, self._tell)
            self._timer.daemon = True
            self._timer.start()

    def end(self) -> None:
        """Note the end of compiling the function begun last."""
        self._depth -= 1
        self._ended = time.monotonic()

    def _tell(self) -> None:
        self._timer = None
        if self._depth and not self._told and not self.quiet:
            self._told = True
            print(LINE if self.is_kept else NOT_KEPT, file=sys.stderr, flush=True)


notice = CompileNotice()
