"""Files are written whole, the disk has them before they take their place, and pages say what made
them.
"""

import gzip
import json
import os
import stat

import pytest
from matplotlib.figure import Figure

from tests.support.outcomes import refused
from tests.support.programs import said
from windwrench import __version__
from windwrench.runtime import whole_files
from windwrench.runtime.page_files import write_figure, write_json, write_text
from windwrench.runtime.provenance import commit, made_by
from windwrench.runtime.whole_files import replaced


@pytest.fixture
def events(monkeypatch):
    """What was kept and put in place, in order."""
    found = []
    fsync = os.fsync
    replace = os.replace

    def kept(descriptor):
        folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        found.append(("keep folder" if folder else "keep file", os.fstat(descriptor).st_ino))
        fsync(descriptor)

    def placed(old, new):
        found.append(("place", os.stat(old).st_ino))
        replace(old, new)

    monkeypatch.setattr(whole_files.os, "fsync", kept)
    monkeypatch.setattr(whole_files.os, "replace", placed)
    return found


def test_a_file_is_kept_before_and_its_folder_after_it_takes_its_place(tmp_path, events):
    path = tmp_path / "new" / "deep" / "file.txt"
    with replaced(path) as partial:
        partial.write_text("whole")
    file = path.stat().st_ino
    folder = path.parent.stat().st_ino
    assert events[-3:] == [("keep file", file), ("place", file), ("keep folder", folder)]
    above = {path.parents[1].stat().st_ino, tmp_path.stat().st_ino}
    assert above <= {number for what, number in events[:-3] if what == "keep folder"}


def test_a_file_that_cannot_be_kept_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "file.txt"
    path.write_text("old")

    def broken(_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(whole_files.os, "fsync", broken)
    with (
        refused(r"file\.txt: cannot be written"),
        replaced(path) as partial,
    ):
        partial.write_text("new")
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]
    assert path.read_text() == "old"


@pytest.mark.parametrize("length", [10, 220, 221, 255])
def test_a_name_may_be_as_long_as_the_disk_allows(length, tmp_path):
    path = tmp_path / ("n" * length)
    for text in ("one", "two"):
        with replaced(path) as partial:
            partial.write_text(text)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "two"


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
    assert json.loads(path.read_bytes()) == {"x": float("inf")}
    with refused("cannot be written"):
        write_json({}, path / "below")
