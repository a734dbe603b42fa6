"""Configurations of training, as data: one YAML file an algorithm; a run may override every key."""

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..controllers.features import Features
from ..controllers.registry import STANDARD_TASK
from ..runtime.errors import InputError, unknown_name
from ..runtime.yaml_file import parse_yaml, read_yaml

Config = dict[str, Any]
ALGORITHMS = ("sac", "ppo", "recurrent-ppo", "td3", "tune")
_COUNTS = ("steps", "environments", "checkpoint")


def load_config(
    algorithm: str,
    overrides: Sequence[str] = (),
    file: Path | None = None,
    task: str | None = None,
) -> Config:
    """Return an algorithm's configuration.

    Args:
        algorithm: one of ``ALGORITHMS``.
        overrides: ``KEY=VALUE`` in YAML, with dots for deeper keys: ``learner.gamma=0.98``.
        file: a YAML file of such keys, nested, merged before ``overrides``.
        task: a task's name; one other than FanTracking has the values of ``tasks.yaml`` first.

    Raises:
        InputError: an unknown algorithm or key, or a value of another kind.
    """
    if algorithm not in ALGORITHMS:
        raise unknown_name("algorithm", algorithm, ALGORITHMS)
    folder = Path(__file__).parent / "configs"
    what = "a configuration of training"
    config: Config = read_yaml(folder / f"{algorithm}.yaml", what)
    others = {} if task in (None, STANDARD_TASK) else read_yaml(folder / "tasks.yaml", what)
    for key, value in others.get(algorithm, {}).items():
        config[key] = {**config[key], **value} if isinstance(value, dict) else value
    if file is not None:
        changes = read_yaml(file, what)
        if not isinstance(changes, dict):
            raise InputError(
                f"{file}: expected keys and values, as in training/configs/{algorithm}.yaml"
            )
        _merge(config, changes, str(file), "")
    for text in overrides:
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise InputError(f"--set {text}: expected KEY=VALUE, such as learner.gamma=0.98")
        nested: Any = parse_yaml(value, f"--set {text}")
        for part in reversed(key.split(".")):
            nested = {part: nested}
        _merge(config, nested, "--set", "")
    if config["algorithm"] != algorithm:
        raise InputError(
            f"{algorithm}: algorithm cannot be overridden, got {config['algorithm']!r}"
        )
    if algorithm != "tune":
        _check(config)
    return config


def _merge(config: Config, changes: Config, where: str, above: str) -> None:
    for key, value in changes.items():
        name = f"{above}{key}"
        if key not in config:
            raise unknown_name("key", name, [f"{above}{k}" for k in config], where)
        old = config[key]
        if isinstance(old, dict):
            if not isinstance(value, dict):
                raise InputError(
                    f"{where}: {name} holds keys of its own ({', '.join(old)}), got {value!r}"
                )
            _merge(old, value, where, f"{name}.")
        else:
            config[key] = _like(old, value, f"{where}: {name}")


def _like(old: Any, value: Any, where: str) -> Any:
    """Return ``value`` in the kind of ``old``."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(old, str) and old.startswith("auto") and number:
        return float(value)  # a coefficient that is found by itself may be fixed
    if isinstance(old, int) and number and float(value).is_integer():
        return int(value)
    if isinstance(old, float) and number:
        return float(value)
    if isinstance(old, str | list) and isinstance(value, type(old)):
        return copy.deepcopy(value)
    kind = {int: "a whole number", float: "a number", str: "a word", list: "a list"}[type(old)]
    raise InputError(f"{where} must be {kind} such as {old!r}, got {value!r}")


def _check(config: Config) -> None:
    name = config["algorithm"]
    counts = {key: config[key] for key in _COUNTS if key in config}
    counts |= {f"validation.{key}": count for key, count in config["validation"].items()}
    for key, count in counts.items():
        if count < 1:
            raise InputError(f"{name}: {key} must be at least 1, got {count}")
    if not all(isinstance(n, int) and n > 0 for n in config["net"]):
        raise InputError(f"{name}: net must list sizes of hidden layers, got {config['net']}")
    words = {"activation": ("relu", "tanh"), "estimator": ("ukf", "constant-gain", "ukf-lanes")}
    for key, choices in words.items():
        if config[key] not in choices:
            raise unknown_name(key, config[key], choices, name)
    features_of(config)


def features_of(config: Config) -> Features:
    """Return the inputs of the configured policy."""
    return Features(tuple(config["features"]["frame"]), config["features"]["history"])
