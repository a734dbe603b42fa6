"""What holds for the whole suite."""

import signal


def pytest_configure(config):
    """Hear interrupts in every process of the suite."""
    hear_interrupts()


def hear_interrupts():
    """Take interrupts as at a terminal, here and in the programs that tests start.

    What a shell starts in the background ignores them, and so would all that it starts.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
