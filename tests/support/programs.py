"""Programs that tests start, and what they wait for."""

import subprocess
import sys
import time


def until(so, wait=time.sleep):
    """Wait until it is so: for 300,000 looks, ten minutes or more. They are counted: on a busy
    machine any time may pass between two.
    """
    for _ in range(300_000):
        if so():
            return
        wait(0.002)
    raise AssertionError("what was waited for has not come")


def said(*words, **options):
    """Return what a program says on standard output; it must succeed."""
    ended = subprocess.run(words, **{"capture_output": True, "text": True} | options)
    assert ended.returncode == 0, f"{words[0]}: {ended.stdout[-3000:]}{ended.stderr[-3000:]}"
    return ended.stdout


def started(*words, of=("-m", "windwrench"), **options):
    """Start the command, or a program of Python's, in a session of its own; what it says goes
    nowhere unless asked for.
    """
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | options
    words = [sys.executable, *of, *map(str, words)]
    return subprocess.Popen(words, start_new_session=True, **streams)
