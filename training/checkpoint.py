"""Checkpoints: a resumed run equals an undisturbed one.

A checkpoint holds every input of the rest of a run: networks, optimisers, replay memory, the state
of every random generator, and the number of each environment's episode. After a checkpoint a run,
killed or not, begins new episodes. A checkpoint is one file of tensors and text; loading runs no
code.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..runtime.errors import InputError
from ..runtime.file_limits import LIMITS
from ..runtime.regular_files import check_archive, check_regular, open_regular
from ..runtime.whole_files import replaced
from .vec_env import FeatureVecEnv

_REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_NORMALS = ("_n_updates", "_episode_num", "num_timesteps")


def save_checkpoint(learner: Any, env: FeatureVecEnv, extra: dict[str, Any], path: Path) -> None:
    """Write the state of a run between two calls of ``learn``; the next call begins new episodes.
    ``extra`` is text, numbers and lists of the run's own.
    """
    kind, keys, *rest = np.random.get_state()  # noqa: NPY002  the generator that SB3 draws from
    state: dict[str, Any] = {
        "parameters": learner.get_parameters(),
        "counters": {name: getattr(learner, name) for name in _NORMALS},
        "torch": torch.get_rng_state(),
        "numpy": torch.from_numpy(np.asarray(keys).astype(np.int64)),
        "text": json.dumps(
            {
                "numpy": [kind, *rest],
                "actions": learner.action_space.np_random.bit_generator.state,
                "episode": env.episode.tolist(),
                "extra": extra,
            }
        ),
    }
    if hasattr(learner, "log_ent_coef"):
        state["log_ent_coef"] = learner.log_ent_coef.detach().clone()
    buffer = getattr(learner, "replay_buffer", None)
    if buffer is not None:
        used = buffer.buffer_size if buffer.full else buffer.pos
        state["replay"] = {name: torch.from_numpy(getattr(buffer, name)[:used]) for name in _REPLAY}
        state["replay_position"] = [buffer.pos, buffer.full]
    with replaced(path) as partial:
        torch.save(state, partial)
    learner._last_obs = None


def load_checkpoint(learner: Any, env: FeatureVecEnv, path: Path) -> dict[str, Any]:
    """Put a new learner and its environments where ``save_checkpoint`` was called; return its
    ``extra``.

    Raises:
        InputError: not a checkpoint of this configuration, a cut one, or one larger than
            ``FileLimits`` allows.
    """
    what = "a checkpoint"
    check_regular(path, what, LIMITS.checkpoint)
    try:
        with open_regular(path, what) as file:
            check_archive(path, file, LIMITS.checkpoint, what, packed=False)
            state = torch.load(file, weights_only=True)
        _check_tensors(state, set())
        return _restore(learner, env, state)
    except InputError:
        raise
    except Exception as error:  # whatever a parser, or a part of a learner, makes of spoiled bytes
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise InputError(
            f"{path}: not a checkpoint of this configuration: {reason}; delete {path.parent} to "
            f"start anew"
        ) from error


def _check_tensors(value: Any, visited: set[int]) -> None:
    """Raise ValueError if a tensor has more numbers than its memory, so that a copy would grow;
    ``visited`` holds the containers so far.
    """
    if isinstance(value, torch.Tensor):
        if value.numel() * value.element_size() > value.untyped_storage().nbytes():
            raise ValueError(f"a tensor of shape {tuple(value.shape)} without that many numbers")
    elif isinstance(value, dict | list | tuple) and id(value) not in visited:
        visited.add(id(value))
        for part in value.values() if isinstance(value, dict) else value:
            _check_tensors(part, visited)


def _restore(learner: Any, env: FeatureVecEnv, state: dict[str, Any]) -> dict[str, Any]:
    learner.set_parameters(state["parameters"], exact_match=True, device="cpu")
    text = json.loads(state["text"])
    buffer = getattr(learner, "replay_buffer", None)
    if buffer is not None:
        for name in _REPLAY:
            getattr(buffer, name)[: len(state["replay"][name])] = state["replay"][name].numpy()
        buffer.pos, buffer.full = state["replay_position"]
    for name, value in state["counters"].items():
        setattr(learner, name, value)
    if "log_ent_coef" in state:
        learner.log_ent_coef.data.copy_(state["log_ent_coef"])
    env.episode[:] = text["episode"]
    learner.action_space.np_random.bit_generator.state = text["actions"]
    torch.set_rng_state(state["torch"])
    kind, *rest = text["numpy"]
    np.random.set_state((kind, state["numpy"].numpy().astype(np.uint32), *rest))  # noqa: NPY002
    extra: dict[str, Any] = text["extra"]
    return extra
