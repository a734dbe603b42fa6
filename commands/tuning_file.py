"""The tuning of a filter as a YAML file: written by ``estimate``, read by ``estimate`` and
``live``.
"""

from pathlib import Path

import numpy as np
import yaml

from ..estimator.tuning import PERIOD, UKFTuning
from ..runtime.errors import InputError, unknown_name
from ..runtime.page_files import write_text
from ..runtime.plain_values import plain
from ..runtime.yaml_file import read_yaml


def save_tuning(tuning: UKFTuning, period: float, path: Path) -> None:
    """Write a tuning of steps of ``period`` s to a YAML file, for steps of 5 ms.

    Raises:
        InputError: the file cannot be written.
    """
    data = plain(tuning.scaled(period, PERIOD), 9)
    for name in ("torque_time", "force_time"):  # of a walk: infinite, which YAML can say
        data[name] = np.asarray(getattr(tuning, name), dtype=np.float64).tolist()
    write_text(yaml.safe_dump(data, sort_keys=False, default_flow_style=None), path)


def load_tuning(path: Path, period: float = PERIOD) -> UKFTuning:
    """Return the tuning of a YAML file for steps of ``period`` s. Its fields are ``UKFTuning``'s
    for steps of 5 ms.

    Raises:
        InputError: the file cannot be read, or a field is unknown or out of range.
    """
    data = read_yaml(path, "a tuning file")
    if not isinstance(data, dict) or not data:
        kind = type(data).__name__
        raise InputError(f"{path}: expected a mapping of fields such as force_walk, got {kind}")
    fields = UKFTuning.__dataclass_fields__
    for name in data:
        if name not in fields:
            raise unknown_name("field", str(name), fields, str(path))
    try:
        return UKFTuning(**data).scaled(PERIOD, period)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
