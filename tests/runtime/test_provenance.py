"""How a page says what made it, and the files that it shows."""

import gzip
import json

import pytest
from matplotlib.figure import Figure

from tests.support.programs import said
from windwrench import __version__
from windwrench.dynamics import InputError
from windwrench.runtime.page_files import write_figure, write_json, write_text
from windwrench.runtime.provenance import commit, made_by


def git(folder, *words):
    return said("git", "-c", "user.name=a", "-c", "user.email=a@b", *words, cwd=folder).strip()


def test_a_checkout_has_a_commit_and_says_what_is_not_in_it(tmp_path):
    checkouts = [tmp_path / name for name in ("clean", "dirty")]
    for folder in checkouts:
        folder.mkdir()
        git(folder, "init", "-q")
        (folder / "file").write_text("one")
        (folder / "docs").mkdir()
        (folder / "docs" / "page.md").write_text("one")
        git(folder, "add", ".")
        git(folder, "commit", "-qm", "one")
        (folder / "docs" / "page.md").write_text("made before this one")
    (tmp_path / "dirty" / "file").write_text("two")
    clean, dirty = (git(folder, "rev-parse", "--short", "HEAD") for folder in checkouts)
    assert [commit(folder) for folder in checkouts] == [clean, f"{dirty}-dirty"]
    (tmp_path / "clean" / "installed").mkdir()
    assert commit(tmp_path / "clean" / "installed") is None  # in another's checkout
    assert commit(tmp_path) is None


def test_the_line_names_command_version_and_every_commit_once():
    assert made_by("windwrench x", ["abc"]) == (
        f"Made by `windwrench x`, windwrench {__version__}, commit abc."
    )
    assert made_by("x", ["abc", None, "def", "abc"], "0.0.9") == (
        "Made by `x`, windwrench 0.0.9, commits abc, def."
    )
    assert made_by("x", [None]) == f"Made by `x`, windwrench {__version__}."


def test_the_same_content_gives_the_same_bytes_whatever_its_name(tmp_path):
    for name in ("a", "b"):
        write_text("x,y\n1,2\n", tmp_path / f"{name}.csv.gz")
        write_json({"x": [1, 2.5]}, tmp_path / f"{name}.json.gz")
        figure = Figure()
        figure.subplots().plot([0, 1])
        assert write_figure(figure, tmp_path, name) == tmp_path / f"{name}.png"
    for kind in ("csv.gz", "json.gz", "png", "svg"):
        one, other = ((tmp_path / f"{name}.{kind}").read_bytes() for name in ("a", "b"))
        assert one == other, kind
    assert gzip.decompress((tmp_path / "a.csv.gz").read_bytes()) == b"x,y\n1,2\n"
    assert gzip.decompress((tmp_path / "a.json.gz").read_bytes()) == b'{"x":[1,2.5]}\n'


def test_json_is_compact_finite_and_whole_or_not_there(tmp_path):
    path = tmp_path / "a.json"
    write_json({"x": 1}, path)
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json({"x": float("nan")}, path)
    assert path.read_text() == '{"x":1}\n'
    write_json({"x": float("inf")}, path, allow_nan=True)
    assert json.loads(path.read_text()) == {"x": float("inf")}
    with pytest.raises(InputError, match="cannot be written"):
        write_json({}, path / "below")
