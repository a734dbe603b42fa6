"""Standard output and standard error of the command: characters outside the encoding are shown as
escapes, and a full disk ends the command in one clear line.
"""

import io
import os
import sys
from typing import cast

from ..runtime.errors import InputError


class _Output(io.FileIO):
    """A stream to a file descriptor. An InputError tells the first failed write, and the rest is
    dropped; a quiet stream tells nothing.
    """

    def __init__(self, descriptor: int, quiet: bool) -> None:
        super().__init__(descriptor, "wb", closefd=False)
        self._quiet, self._failed = quiet, False

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        """Write some bytes; return how many.

        Raises:
            BrokenPipeError: the reader has enough.
            InputError: they cannot be written.
        """
        if self._failed:
            return len(data)
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            raise
        except OSError as error:
            self._failed = True
            if self._quiet:
                return len(data)
            reason = error.strerror or error
            raise InputError(f"standard output cannot be written: {reason}") from error


def prepare_output() -> None:
    """Put such streams in the place of the process's own; others in their place, such as a test's,
    stay.
    """
    for name, quiet in (("stdout", False), ("stderr", True)):
        stream = getattr(sys, name)
        if stream is None:  # closed by whoever started the process
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif stream is getattr(sys, f"__{name}__") and isinstance(stream, io.TextIOWrapper):
            stream.flush()
            raw = _Output(stream.fileno(), quiet)
            text = io.TextIOWrapper(
                io.BufferedWriter(cast(io.RawIOBase, raw)),
                stream.encoding,
                "backslashreplace",
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, text)
