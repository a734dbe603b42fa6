"""A first call that compiles says so; the next one does not."""

import os
import subprocess
import sys
import time

import pytest

from windwrench.runtime.compiled import announced

CODE = (
    "import gymnasium, windwrench\nenv = "
    "gymnasium.make('windwrench/FanTracking-v0')\nenv.reset(seed=0)\n"
    "print(env.step([0.1])[0].tobytes().hex())"
)


def test_a_wait_is_explained_and_a_short_one_is_not(capsys):
    with announced(patience=0.05):
        time.sleep(0.3)
    assert "compiling" in capsys.readouterr().err
    with announced(patience=5.0):
        pass
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_a_cold_and_a_warm_start_give_the_same_bits(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    cold, *warm = (
        subprocess.run(
            [sys.executable, "-c", CODE],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
        )
        for _ in range(4)
    )
    assert cold.returncode == 0, cold.stderr
    assert "compiling" in cold.stderr
    # on a busy machine even loading may take longer than the patience; compiling would take longer
    # every time
    assert any("compiling" not in run.stderr for run in warm)
    assert all(cold.stdout == run.stdout for run in warm)
