"""What holds for the whole suite."""

import subprocess
import sys

COMPILED = "from tests.support.compiled_estimates import compile_estimates; compile_estimates()"


def pytest_configure(config):
    """Compile what most files need before workers start, or each of them compiles it."""
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        # a failure is no answer here: the tests that need it will give theirs
        subprocess.run(
            [sys.executable, "-c", COMPILED], cwd=config.rootpath, capture_output=True, check=False
        )
