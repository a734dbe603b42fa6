"""Programs that tests start."""

import subprocess
import sys

WINDWRENCH = (sys.executable, "-m", "windwrench")


def said(*words, **options):
    """Return what a program says on standard output; it must succeed."""
    ended = subprocess.run(words, **{"capture_output": True, "text": True} | options)
    assert ended.returncode == 0, f"{words[0]}: {ended.stdout[-3000:]}{ended.stderr[-3000:]}"
    return ended.stdout


def started(*words, **options):
    """Start the command in a session of its own; what it says goes nowhere unless asked for."""
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | options
    return subprocess.Popen([*WINDWRENCH, *map(str, words)], start_new_session=True, **streams)
