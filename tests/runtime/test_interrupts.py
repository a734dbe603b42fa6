"""Interrupts that come where an exception is lost."""

import signal
import time
import weakref

import pytest

from windwrench.runtime.interrupts import noted


class Thing:
    """Something to be collected."""


def test_one_that_a_callback_loses_comes_again():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with noted() as came:
            thing = Thing()
            reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
            with pytest.raises(KeyboardInterrupt):
                del thing
                time.sleep(5.0)
            assert came()
            assert reference() is None
    finally:
        signal.signal(signal.SIGINT, before)
