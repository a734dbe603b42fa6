"""What holds for the whole suite."""

import os
import signal
import subprocess
import sys

COMPILED = (
    "from tests.support.compiling import compile_estimates; compile_estimates()",
    "from tests.support.compiling import compile_environments; compile_environments()",
)


def pytest_configure(config):
    """Compile what most files need before workers start, or each of them compiles it; a part of
    the suite compiles what it needs.

    Lines of the compiler's own would be followed for nothing where lines are counted.
    """
    hear_interrupts()
    whole = config.args == ["tests"]
    if (
        whole
        and getattr(config.option, "numprocesses", None)
        and not hasattr(config, "workerinput")
    ):
        counted = ("COVERAGE_PROCESS_", "COV_CORE_")
        environment = {k: v for k, v in os.environ.items() if not k.startswith(counted)}
        running = [
            subprocess.Popen(
                [sys.executable, "-c", source],
                cwd=config.rootpath,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for source in COMPILED
        ]
        for process in running:
            process.wait()  # a failure is no answer here: the tests that need it give theirs


def hear_interrupts():
    """Take interrupts as at a terminal, here and in the programs that tests start.

    What a shell starts in the background ignores them, and so would all that it starts.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
