"""One line on standard error where compiling takes more than a moment.

``runtime.compiled`` reports when Numba compiles. This module imports nothing heavy, so that a
command can silence the notice at its start.
"""

import sys
import threading

PATIENCE = 2.0  # s of compiling until the line
LINE = "windwrench: compiling, once for this installation; later starts load it"


class CompileNotice:
    """Prints the line once, 2 s after compiling began, where it still goes on."""

    def __init__(self, patience: float = PATIENCE) -> None:
        self.quiet = False
        self._patience = patience
        self._depth = 0  # a function compiles those that it calls
        self._timer: threading.Timer | None = None
        self._told = False

    def begin(self) -> None:
        """Note that a function is compiled from now on."""
        self._depth += 1
        if self._timer is None and not self._told:
            self._timer = threading.Timer(self._patience, self._tell)
            self._timer.daemon = True
            self._timer.start()

    def end(self) -> None:
        """Note that the function that began last is compiled."""
        self._depth -= 1

    def _tell(self) -> None:
        self._timer = None
        if self._depth and not self._told and not self.quiet:
            self._told = True
            print(LINE, file=sys.stderr, flush=True)


notice = CompileNotice()
