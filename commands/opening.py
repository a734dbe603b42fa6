"""Opening a page in the user's browser, where there is one to see it."""

import os
import sys
import webbrowser
from contextlib import suppress
from pathlib import Path

from .terminal import console


def show_page(path: Path, wanted: bool) -> None:
    """Say where a page is, and open it in a browser if that is wanted and a display is there."""
    whole = path.resolve()
    console.print(f"page: {whole.as_uri()}", highlight=False, markup=False, soft_wrap=True)
    display = not sys.platform.startswith("linux") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if wanted and display and not console.quiet:
        with suppress(webbrowser.Error, OSError):
            webbrowser.open(whole.as_uri())
