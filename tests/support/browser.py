"""A page as a real browser shows it: what it complains about, what overflows, which pictures are
missing.
"""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
needs_browser = pytest.mark.skipif(
    BROWSER is None, reason="no browser is installed: apt-get install chromium fonts-dejavu-core"
)

# A window cannot be as narrow as a telephone, a frame in it can. Whatever goes wrong before it is
# looked at is kept.
_FRAME = Path(__file__).with_name("browser_frame.html").read_text(encoding="utf-8")


def browse(address, profile, *options):
    """Run the browser: standard output is the page as it then is, errors are its complaints."""
    alone = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
    told = ("--enable-logging=stderr", "--virtual-time-budget=5000", "--timeout=20000")
    options += (f"--user-data-dir={profile}", "--no-first-run", "--dump-dom", address)
    return subprocess.run(
        [BROWSER, *alone, *told, *options], capture_output=True, text=True, timeout=120
    )


def look(page, width, folder, dark=False, act="", scripts=True):
    """Show a page (HTML text) ``width`` pixels wide; return what was found in it, with the
    browser's ``complaints``.

    ``act`` is the body of an asynchronous JavaScript function of the page's document (``page``) and
    window (``view``), called last; what it returns is ``done``. Without ``scripts`` the page's own
    do not run.
    """
    path = Path(folder) / "frame.html"
    path.write_text(
        _FRAME.format(
            width=width,
            page=html.escape(page),
            act=act,
            sandbox="" if scripts else 'sandbox="allow-same-origin"',
        ),
        encoding="utf-8",
    )
    for attempt in range(3):  # on a busy machine a browser may die before it has shown anything
        shown = browse(
            path.resolve().as_uri(),
            Path(folder) / f"profile{attempt}",
            "--hide-scrollbars",
            f"--blink-settings=preferredColorScheme={0 if dark else 1}",
            f"--window-size={max(width, 500)},1000",
        )
        dumped = re.search(r'<pre id="found">(.+?)</pre>', shown.stdout, re.DOTALL)
        if dumped:
            break
    assert dumped, f"{BROWSER} ended with {shown.returncode}: {shown.stderr[-2000:]}"
    found = json.loads(html.unescape(dumped[1]))
    found["complaints"] = [
        line
        for line in shown.stderr.splitlines()
        if "CONSOLE" in line and (scripts or "Blocked script execution" not in line)
    ]
    return found
