"""Interrupts that come where an exception is lost."""

import signal
import time
import weakref

import pytest

from windwrench.runtime.interrupts import noted


class Thing:
    """Something to be collected."""


def lose(things):
    """Have an interrupt come within the callback of something that is collected."""
    reference = weakref.ref(things[0], lambda _: signal.raise_signal(signal.SIGINT))
    things.clear()
    time.sleep(5.0)
    assert reference() is None


def test_one_that_a_callback_loses_comes_again():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with noted() as came:
            with pytest.raises(KeyboardInterrupt):
                lose([Thing()])
            assert came()
    finally:
        signal.signal(signal.SIGINT, before)
