"""A tuning as a file: the same again, for any period; golden error lines refuse wrong ones."""

from dataclasses import fields

import numpy as np
import pytest

from windwrench.commands.tuning_file import load_tuning, save_tuning
from windwrench.estimator import UKFTuning

TRUE = UKFTuning(force_walk=(0.02, 0.02, 0.008), thrust_noise=0.3)


def test_a_tuning_is_kept_in_a_file_for_any_period(tmp_path):
    path = tmp_path / "tuning.yaml"
    save_tuning(TRUE, 0.01, path)
    again = load_tuning(path, 0.01)
    for field in fields(TRUE):
        given = getattr(TRUE, field.name)
        assert getattr(again, field.name) == pytest.approx(given, rel=1e-8)
    halved = load_tuning(path, 0.005)
    assert np.allclose(halved.force_walk, np.asarray(TRUE.force_walk) / 2**0.5)
    assert halved.thrust_noise == pytest.approx(0.3 * 2**0.5)
    assert halved.position_noise == TRUE.position_noise
