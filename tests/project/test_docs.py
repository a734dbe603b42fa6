"""Every code block of README and documentation is run, page by page, from top to bottom, in an
empty folder.

``sh`` blocks run in a shell, ``python`` blocks in one namespace a page; a block with a ``title`` is
written to a file of that name. Under the comment ``<!-- dry run -->`` commands are run with
``--dry-run``, and modules of Python with ``--help``: they would take minutes. ``pip`` and ``make``
are not run; what they name must exist. Blocks of other languages are not code to run, except that
YAML must be YAML.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from markdown_it import MarkdownIt
from typer.main import get_command

from tests.support.data_paths import DATA
from tests.support.paths import ROOT
from windwrench.cli import app

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
DRY_RUN = "<!-- dry run -->"
NOT_CODE = {"", "text", "yaml"}
QUICK = {"effects.md", "estimator.md", "index.md", "tasks.md"}  # the others fly for long


def blocks(page):
    """Yield (line, language, title, dry run, content) of a page's code blocks."""
    dry = False
    for token in MarkdownIt().parse(page.read_text(encoding="utf-8")):
        if token.type == "fence":
            language, _, rest = token.info.strip().partition(" ")
            title = re.search(r'title="(.*?)"', rest)
            yield token.map[0] + 2, language, title and title.group(1), dry, token.content
        if token.type == "html_block":
            dry = token.content.strip() == DRY_RUN
        elif token.level == 0:
            dry = False


def pages_with_code():
    return [
        page if page.name in QUICK else pytest.param(page, marks=pytest.mark.slow)
        for page in PAGES
        if any(language not in NOT_CODE for _, language, *_ in blocks(page))
    ]


def commands(content):
    """Yield the words of each command of a shell block, without its comments."""
    for line in content.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            yield words


def check_pip(words):
    extras = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    for word in words[2:]:
        for extra in re.findall(r"\[(.*?)\]", word):
            assert all(re.search(rf"^{name} = \[", extras, re.M) for name in extra.split(",")), (
                f"no extra {extra}"
            )


def run_shell(content, environment, dry, where):
    for words in commands(content):
        if words[:2] == ["pip", "install"]:
            check_pip(words)
        elif words[0] == "make":
            targets = (ROOT / "Makefile").read_text(encoding="utf-8")
            assert re.search(rf"^{words[1]}:", targets, re.M), f"no target {words[1]}"
        elif "--cluster" in words and find_spec("ray") is None:
            continue
        elif words[0] == "export":
            name, _, value = words[1].partition("=")
            environment[name] = value
        else:
            words += [] if not dry else ["--help" if words[0] == "python" else "--dry-run"]
            done = subprocess.run(words, env=environment, capture_output=True, text=True)
            said = f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
            assert done.returncode == 0, f"{where}: {shlex.join(words)}\n{said}"


def prepare(page, folder):
    """Put there what a page takes for given: logs of others, and a law of the reader's."""
    if page.name == "leaderboard.md":
        law = "class MyLaw:\n    def __call__(self, observation, info):\n        return [0.0] * 3\n"
        (folder / "my_law.py").write_text(law)
    if page.name == "diagnose.md":
        from tests.support.converted_flights import write_bag, write_ulog
        from windwrench.identification.logs.reading import read_log

        drag = ("--effect", "rotor_drag:kdx=1.2e-4,kdy=1.2e-4", "--seconds", "40", "--seed", "1")
        given = ("--quiet", "--out", str(folder / "given.csv"))
        app(["record", *drag, *given], standalone_mode=False)
        log = read_log(folder / "given.csv")
        write_ulog(log, folder / "flight.ulg")
        write_bag(log, folder / "flight_bag")
    policies = re.findall(r"results/[\w-]+/best", page.read_text(encoding="utf-8"))
    for name in policies if page.name != "train.md" else ():  # what a dry run does not train
        for ending in (".npz", ".json"):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            kept = ROOT / "training" / "policies" / f"sac-0{ending}"
            shutil.copy(kept, folder / f"{name}{ending}")
    if page.name == "own-vehicle.md":
        shutil.copytree(ROOT / "examples", folder, dirs_exist_ok=True)
    for name in {*re.findall(r"\b(?:B\d\w+\.csv|log1\d)\b", page.read_text(encoding="utf-8"))}:
        found = next(iter(DATA.rglob(name)), None)
        if found is None:
            pytest.skip(f"{page.name} reads the measured flight {name}, which is not here")
        (folder / name).symlink_to(found)


@pytest.mark.parametrize("page", pages_with_code(), ids=lambda page: str(page.relative_to(ROOT)))
def test_every_code_block_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    bin_folder = str(Path(sys.executable).parent)
    environment = {
        **os.environ,
        "PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}",
        "NO_COLOR": "1",
    }
    prepare(page, tmp_path)
    names = {"__name__": "__main__"}
    for line, language, title, dry, content in blocks(page):
        where = f"{page.relative_to(ROOT)}:{line}"
        if language == "yaml":
            assert yaml.safe_load(content), where
        if title:
            Path(title).parent.mkdir(parents=True, exist_ok=True)
            Path(title).write_text(content, encoding="utf-8")
        elif language == "python":
            exec(compile(content, where, "exec"), names)
        elif language == "sh":
            run_shell(content, environment, dry, where)
        else:
            assert language in NOT_CODE, f"{where}: a block of {language!r} is not run"


def test_pages_name_commands_that_are_there():
    verbs = set(get_command(app).commands)
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        named = set(re.findall(r"`windwrench ([a-z][a-z-]+)(?=[ `])", text))
        assert named <= verbs, page.name
