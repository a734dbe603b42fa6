"""Files are written whole, and the disk has them before they take their place."""

import os
import stat

import pytest

from windwrench.runtime import whole_files
from windwrench.runtime.errors import InputError
from windwrench.runtime.whole_files import replaced


@pytest.fixture
def events(monkeypatch):
    """What was kept and put in place, in order."""
    found = []
    fsync, replace = os.fsync, os.replace

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
    file, folder = path.stat().st_ino, path.parent.stat().st_ino
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
        pytest.raises(InputError, match=r"file\.txt: cannot be written"),
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
