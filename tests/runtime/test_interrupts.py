"""Interrupts that come where an exception is lost."""

import signal
import time
import weakref
from contextlib import suppress

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


def swallow(_):
    """Have an interrupt come within code that goes on whatever happens, as imports in C do."""
    with suppress(BaseException):
        signal.raise_signal(signal.SIGINT)
    time.sleep(5.0)


@pytest.mark.parametrize("loses", [lose, swallow])
def test_one_that_is_lost_comes_again_until_it_has_an_answer(loses):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with noted() as came:
            with pytest.raises(KeyboardInterrupt):
                loses([Thing()])
            assert came()
            time.sleep(0.1)
    finally:
        signal.signal(signal.SIGINT, before)
