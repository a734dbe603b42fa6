"""What the tests of commands share."""

import sys

import pytest

from windwrench.cli import app, main


def recorded(path, *words, effect="constant_force:fx=0.2", seconds=12):
    """Record a flight with an effect, a force of 0.2 N along x, into a file; return its path."""
    chosen = ("--effect", effect, "--seconds", str(seconds), *words, "--out", str(path))
    app(["record", *chosen], standalone_mode=False)
    return path


@pytest.fixture
def call(tmp_path, monkeypatch, capfd):
    """Run a command in ``tmp_path`` and without a display, in this process to save its start;
    return exit code, standard output and error.
    """

    def run_here(*arguments):
        monkeypatch.chdir(tmp_path)
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setattr(sys, "argv", ["windwrench", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        said = capfd.readouterr()
        return ended.value.code or 0, said.out, said.err

    return run_here
