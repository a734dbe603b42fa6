"""What an interrupted training finds in its folder when it goes on: files that are empty, cut or of
another kind are named in one line.
"""

import io
import json
import os
import pickle
import shutil
import zipfile

import pytest

pytest.importorskip("torch", reason="pip install 'windwrench[rl]'")
pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")

import torch

from tests.training.tiny import TINY
from windwrench.runtime.errors import InputError
from windwrench.training.configuration import load_config
from windwrench.training.run import read_progress
from windwrench.training.train import train

SHORT = [*TINY, "steps=120", "learner.learning_starts=20", "learner.buffer_size=500"]
NAMES = ("checkpoint.pt", "training.json")


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stopped") / "run"
    train(load_config("sac", SHORT), "base", 0, folder, stop_after=60)
    return folder


def packed(data):
    """Return an archive with the same members, packed."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w", 8) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    return out.getvalue()


def with_state(change):
    """Return what spoils a checkpoint by changing what it holds."""

    def spoil(data):
        state = torch.load(io.BytesIO(data), weights_only=True)
        out = io.BytesIO()
        torch.save(change(state), out)
        return out.getvalue()

    return spoil


def with_text(**changes):
    return with_state(
        lambda state: {**state, "text": json.dumps({**json.loads(state["text"]), **changes})}
    )


SPOILED = {
    "empty": lambda data: b"",
    "cut in the middle": lambda data: data[: len(data) // 2],
    "a pickle": lambda data: pickle.dumps({"parameters": 1}),
    "deep": lambda data: b"[" * 100_000,
}
CHECKPOINTS = {
    "packed": packed,
    "no mapping": with_state(lambda state: [1, 2]),
    "lacks an entry": with_state(
        lambda state: {name: value for name, value in state.items() if name != "counters"}
    ),
    "a text for tensors": with_state(lambda state: {**state, "replay": "none"}),
    "a tensor of no memory": with_state(
        lambda state: {**state, "numpy": torch.zeros(1, dtype=torch.int64).expand(10**9)}
    ),
    "episodes of other environments": with_text(episode=[0, 0, 0]),
    "progress of another kind": with_text(extra={"steps": 3}),
    "progress that is a list": with_text(extra=[1]),
    "no generator": with_text(numpy=["MT19937"]),
    "counters of another kind": with_state(lambda state: {**state, "counters": 5}),
}
CASES = [(name, how) for name in NAMES for how in SPOILED] + [
    ("checkpoint.pt", how) for how in CHECKPOINTS
]


@pytest.mark.parametrize(("name", "how"), CASES, ids=[f"{n}, {h}" for n, h in CASES])
def test_a_spoiled_file_is_named_in_one_line(name, how, stopped, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    path = folder / name
    path.write_bytes((SPOILED | CHECKPOINTS)[how](path.read_bytes()))
    with pytest.raises(InputError) as refused:
        train(load_config("sac", SHORT), "base", 0, folder)
    message = str(refused.value)
    assert message.startswith((f"{path}: ", f"{folder}: "))
    assert len(message) < 700
    assert "\n" not in message


@pytest.mark.parametrize("name", NAMES)
def test_a_pipe_in_its_place_is_refused_at_once(name, stopped, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    (folder / name).unlink()
    os.mkfifo(folder / name)
    with pytest.raises(InputError, match=f"{name}: is a pipe"):
        train(load_config("sac", SHORT), "base", 0, folder)


@pytest.mark.parametrize("text", ["", "[]", "7", '{"steps": 1}', '{"steps": ["a"]}', '{"x": 1}'])
def test_progress_of_another_kind_is_refused(text, tmp_path):
    (tmp_path / "progress.json").write_text(text)
    with pytest.raises(InputError, match=r"progress\.json: "):
        read_progress(tmp_path)
