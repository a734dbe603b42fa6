"""Trained policies as files: weights in ``NAME.npz``, and beside them their card ``NAME.json``.

Loading runs no code. Policies fly in plain NumPy, without a deep-learning library.
"""

import hashlib
import io
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..runtime.arrays import Floats, Single
from ..runtime.errors import InputError
from ..runtime.file_limits import LIMITS
from ..runtime.page_files import write_text
from ..runtime.regular_files import check_archive, read_bytes, read_json, reading
from ..runtime.whole_files import replaced
from .features import Features, History
from .observation import MAX_COMMAND

Weights = dict[str, Single]
FORMAT = 1
_ACTIVATIONS: dict[str, Callable[[Single], Single]] = {
    "relu": lambda x: np.maximum(x, np.float32(0.0)),
    "tanh": np.tanh,
}


def layers_of(weights: Weights) -> int:
    """Return the number of dense layers."""
    return sum(name.startswith("weight") for name in weights)


def _lstm(weights: Weights, x: Single, hidden: Single, cell: Single) -> tuple[Single, Single]:
    """Return the next hidden state and cell (h,) of an LSTM with gates in the order input, forget,
    cell, output.
    """
    gates = (
        weights["lstm_input"] @ x
        + weights["lstm_input_bias"]
        + weights["lstm_hidden"] @ hidden
        + weights["lstm_hidden_bias"]
    )
    i, f, g, o = np.split(gates, 4)
    cell = _sigmoid(f) * cell + _sigmoid(i) * np.tanh(g)
    after: Single = _sigmoid(o) * np.tanh(cell)
    return after, cell


def _gru(weights: Weights, x: Single, hidden: Single, cell: Single) -> tuple[Single, Single]:
    """Return the next hidden state (h,) of a GRU with gates in the order reset, update, new, and
    the unused ``cell``.
    """
    entered = weights["gru_input"] @ x + weights["gru_input_bias"]
    recurrent = weights["gru_hidden"] @ hidden + weights["gru_hidden_bias"]
    size = len(hidden)
    gates = _sigmoid(entered[: 2 * size] + recurrent[: 2 * size])
    reset, update = gates[:size], gates[size:]
    new = np.tanh(entered[2 * size :] + reset * recurrent[2 * size :])
    after: Single = new + update * (hidden - new)
    return after, cell


# gates and step of each recurrent cell
_CELLS = {"lstm": (4, _lstm), "gru": (3, _gru)}


def cell_of(weights: Weights) -> str | None:
    """Return the recurrent cell before the dense layers: lstm, gru, or none."""
    return next((name for name in _CELLS if f"{name}_input" in weights), None)


def _sigmoid(x: Single) -> Single:
    between: Single = (0.5 * (1.0 + np.tanh(0.5 * x))).astype(np.float32)
    return between


class _Network:
    """Base of the policies: a recurrent cell, if any, and dense layers.

    The card has ``activation``, and ``squash``: a tanh of the output is a share of the largest
    action.
    """

    def __init__(
        self, card: Mapping[str, Any], weights: Weights, seen: int, largest: float, name: str
    ) -> None:
        self.card, self.weights, self._largest = dict(card), weights, largest
        self._activation, self._squash = str(card["activation"]), bool(card["squash"])
        if self._activation not in _ACTIVATIONS:
            raise InputError(
                f"{name}: activation must be one of {', '.join(_ACTIVATIONS)}, got "
                f"{self._activation!r}"
            )
        self._cell = cell_of(weights)
        self._memory_size, below = 0, seen
        shapes: dict[str, tuple[int, ...]] = {}
        if self._cell is not None:
            rows = len(weights[f"{self._cell}_input"])
            below = self._memory_size = rows // _CELLS[self._cell][0]
            shapes = {
                f"{self._cell}_input": (rows, seen),
                f"{self._cell}_hidden": (rows, below),
                f"{self._cell}_input_bias": (rows,),
                f"{self._cell}_hidden_bias": (rows,),
            }
        for i in range(max(layers_of(weights), 1)):
            rows = len(weights.get(f"weight{i}", ()))
            shapes |= {f"weight{i}": (rows, below), f"bias{i}": (rows,)}
            below = rows
        for part, shape in shapes.items():
            actual = weights[part].shape if part in weights else "none"
            if actual != shape:
                raise InputError(f"{name}: {part} must have the shape {shape}, got {actual}")
        self.size = below  # numbers of an action

    def reset(self) -> None:
        """Forget the last episode."""
        size = self._memory_size
        self._hidden, self._kept = (np.zeros(size, dtype=np.float32) for _ in range(2))

    def act(self, x: Single) -> Single:
        """Return the action for inputs (n,); a recurrent policy has a memory of earlier inputs."""
        if self._cell is not None:
            _, step = _CELLS[self._cell]
            self._hidden, self._kept = step(self.weights, x, self._hidden, self._kept)
            x = self._hidden
        last = layers_of(self.weights) - 1
        for i in range(last + 1):
            x = self.weights[f"weight{i}"] @ x + self.weights[f"bias{i}"]
            if i < last:
                x = _ACTIVATIONS[self._activation](x)
        if self._squash:
            x = np.tanh(x) * np.float32(self._largest)
        return np.clip(x, -self._largest, self._largest).astype(np.float32)


@contextmanager
def _entries_named(name: str) -> Iterator[None]:
    """Name a missing or spoiled entry of a card."""
    try:
        yield
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError) and str(error).startswith(name):
            raise
        raise InputError(f"{name}: the card lacks or spoils an entry: {error}") from error


class TrainedPolicy(_Network):
    """A learned policy of ``FanTracking``, as a controller.

    Args:
        card: ``features``, ``repeat`` (decisions a command), ``activation``, ``squash`` (the output
            goes through a tanh), and the policy's origin.
        weights: dense layers ``weight0`` (out, in), ``bias0`` (out,), ... Before them a recurrent
            cell, if any. An LSTM has ``lstm_input`` (4h, in), ``lstm_hidden`` (4h, h),
            ``lstm_input_bias``, ``lstm_hidden_bias`` (4h,). A GRU has ``gru_input`` (3h, in) and so
            on.

    Raises:
        InputError: card and weights do not go together.
    """

    task = "FanTracking"

    def __init__(self, card: Mapping[str, Any], weights: Weights, name: str = "policy") -> None:
        with _entries_named(name):
            seen = card["features"]
            self.features = Features(
                tuple(seen["frame"]), int(seen["history"]), tuple(map(float, seen["scale"]))
            )
            self._repeat = int(card["repeat"])
            if self._repeat < 1:
                raise InputError(f"{name}: repeat must be at least 1, got {self._repeat}")
            super().__init__(card, weights, self.features.size, MAX_COMMAND, name)
        if self.size != 1:
            raise InputError(f"{name}: the last layer must give one number, got {self.size}")
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        super().reset()
        self._history = History(self.features, 1)
        self._count, self._held = 0, np.zeros(1, dtype=np.float32)

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Single:
        """Return the command (1,) m/s for an observation (8,)."""
        if self._count % self._repeat == 0:
            remember = self._history.push if self._count else self._history.restart
            remember(self.features.frames(np.asarray(observation)[None]))
            self._held = self.act(self._history.flat()[0])
        self._count += 1
        return self._held


class TaskPolicy(_Network):
    """A learned policy of another task: scaled observations, and the same layers.

    Args:
        card: ``task``; ``observation``, if another than the task's own; ``scale`` (n,), divisors
            of the observation; ``largest``, the largest action; ``activation``.
            ``squash``: a tanh of the output is a share of ``largest``. ``memory``
            (m,), if any: the layers see m first-order low-passes of the observation, each of so
            many decisions.
        weights: as of a ``TrainedPolicy``.

    Raises:
        InputError: card and weights do not go together.
    """

    def __init__(self, card: Mapping[str, Any], weights: Weights, name: str = "policy") -> None:
        with _entries_named(name):
            self.task, largest = str(card["task"]), float(card["largest"])
            self.observation = card.get("observation")  # None: the task's own
            self._scale = np.array(card["scale"], dtype=np.float32)
            memory = np.array(card.get("memory", [1.0]), dtype=np.float32)
            if self._scale.ndim != 1:
                raise InputError(f"{name}: scale must be a list of numbers")
            if memory.ndim != 1 or not np.all(memory >= 1.0):
                raise InputError(f"{name}: memory must be a list of numbers from 1 on")
            self._rates = 1.0 / memory[:, None]
            super().__init__(card, weights, len(self._scale) * len(memory), largest, name)
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        super().reset()
        self._remembered: Single | None = None

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Single:
        """Return the action of the task, in its units, for an observation in SI units."""
        seen = (np.asarray(observation) / self._scale).astype(np.float32)
        before = seen if self._remembered is None else self._remembered
        self._remembered = before + self._rates * (seen - before)
        return self.act(self._remembered.ravel())


def save_policy(card: Mapping[str, Any], weights: Weights, path: Path) -> Path:
    """Write ``path`` (.npz) and the card beside; return the path. The same weights give the same
    bytes.
    """
    buffer = io.BytesIO()
    arrays: Any = {name: np.asarray(w, dtype=np.float32) for name, w in sorted(weights.items())}
    np.savez(buffer, **arrays)
    data = buffer.getvalue()
    full = {"format": FORMAT, **card, "sha256": hashlib.sha256(data).hexdigest()}
    with replaced(path) as partial:
        partial.write_bytes(data)
    write_text(json.dumps(full, indent=1, allow_nan=False) + "\n", path.with_suffix(".json"))
    return path


def load_policy(path: str | Path) -> Any:
    """Return the policy of a ``.npz`` file or of its card: a ``TrainedPolicy``, or a
    ``TaskPolicy`` if the card names another task.

    Raises:
        InputError: a file is missing, not readable, of another format, larger than ``FileLimits``
            allows, or card and weights do not go together.
    """
    file = Path(path).with_suffix(".npz")
    card_file = file.with_suffix(".json")
    for path in (card_file, file):
        if not os.path.lexists(path):
            raise InputError(
                f"{path}: no such file; a trained policy is a .npz file with its .json card"
            )
    card = read_json(card_file, "a policy's card")
    data = read_bytes(file, "a policy's weights", LIMITS.policy_file)
    if not isinstance(card, dict) or card.get("format") != FORMAT:
        raise InputError(f"{card_file}: format must be {FORMAT}, a trained policy's card")
    if card.get("sha256") != hashlib.sha256(data).hexdigest():
        raise InputError(
            f"{file}: not the weights that its card {card_file.name} describes (sha256 differs)"
        )
    check_archive(file, io.BytesIO(data), LIMITS.policy_weights, "weights")
    with reading(file, "weights"), np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        weights = {name: np.asarray(arrays[name], dtype=np.float32) for name in arrays.files}
    bad = [
        name
        for name, array in weights.items()
        if not np.all(np.isfinite(array)) or array.ndim not in (1, 2)
    ]
    if bad:
        raise InputError(f"{file}: {bad[0]} must be a vector or a matrix of finite numbers")
    kind = TaskPolicy if "task" in card else TrainedPolicy
    return kind(card, weights, str(file))


def is_policy_path(name: str) -> bool:
    """Whether a controller's name is the path of a trained policy."""
    return name.endswith((".npz", ".json"))
