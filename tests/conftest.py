"""What holds for the whole suite."""

import gc
import signal

import pytest


def pytest_configure(config):
    """Hear interrupts in every process of the suite."""
    hear_interrupts()


def pytest_collection():
    """Collect tests without the collector of garbage, which finds none."""
    gc.disable()


def pytest_collection_finish():
    """Keep what was imported from the collector, too."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def coarse_pictures():
    """Draw pictures in 20 dots an inch: whole, and rendered in less than half of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("windwrench.runtime.page_files._DPI", 20)
        yield


def hear_interrupts():
    """Take interrupts as at a terminal, here and in the programs that tests start.

    What a shell starts in the background ignores them, and so would all that it starts.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
