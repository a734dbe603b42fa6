"""Controllers and effects in files of a user's own: found, used by commands and their workers, and
refused in clear words.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.support.outcomes import refused
from tests.support.own_effects import HOSE, forget
from windwrench.dynamics import effects, load_vehicle
from windwrench.dynamics.effects import compile_effects, parse_setting
from windwrench.evaluation.tasks import make_pilot
from windwrench.identification.report.words import effect_summary
from windwrench.runtime.python_file import is_file_name

LAWS = """
import numpy as np
LIMIT = 1.0

class Left:
    def __init__(self, speed=0.25):
        self.speed = speed
    def __call__(self, observation, info=None):
        return np.array([min(self.speed, LIMIT)], dtype=np.float32)
"""
# starts, without which a pull that comes and goes is refused
EFFECT = HOSE.replace("# more", "starting_points=lambda flights: [{'a': 0.2, 'w': 3.0}]")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder for effects that has left the library again once the test is over."""
    monkeypatch.setenv("WINDWRENCH_EFFECTS", "")
    yield tmp_path
    monkeypatch.undo()
    forget()


def test_a_class_of_a_file_is_a_controller(tmp_path):
    laws = tmp_path / "laws.py"
    laws.write_text(LAWS)
    for name in (f"{laws}:Left", str(laws)):
        assert is_file_name(name)
        assert make_pilot(name)(np.zeros(8)) == pytest.approx([0.25])
    assert not is_file_name("admittance")
    assert not is_file_name("results/sac/best.npz")
    subclass = laws.with_name("stiff.py")
    subclass.write_text(
        "from windwrench.controllers import Admittance\n\nclass Stiff(Admittance):\n    def "
        "__init__(self):\n"
        "        super().__init__(40.0)\n"
    )
    assert make_pilot(str(subclass)).gain == 40.0


def test_a_folder_s_files_join_the_library(folder):
    (folder / "hose.py").write_text(EFFECT)
    (folder / "_helper.py").write_text("x = 1")
    assert effects.add_folder(folder) == ("hose",)
    assert "hose" in effects.names()
    assert "rotor_drag" in effects.names()
    assert os.environ["WINDWRENCH_EFFECTS"] == str(folder)
    setting = parse_setting("hose")
    assert setting.coefficients == {"a": 0.2, "w": 3.0}
    assert compile_effects(load_vehicle("ardrone2").with_effects(setting)).wrench_models[0] != 0
    assert effect_summary("hose") == "A pull that comes and goes."
    effects.add_folder(folder)  # once more changes nothing
    assert os.environ["WINDWRENCH_EFFECTS"] == str(folder)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1", "expected EFFECT = Effect.name='own_spring'"),
        (EFFECT, "expected EFFECT = Effect.name='own_spring', ....*got 'hose'"),
        ("raise RuntimeError('no')", "line 1: RuntimeError: no"),
    ],
)
def test_what_is_no_effect_is_named(text, words, folder):
    (folder / "own_spring.py").write_text(text)
    effects.add_folder(folder)
    with refused(words):
        effects.get("own_spring")


def test_a_name_that_is_taken_or_a_folder_that_is_not_there_leaves_the_library_as_it_was(folder):
    (folder / "rotor_drag.py").write_text(EFFECT)
    with refused("an effect rotor_drag is there already"):
        effects.add_folder(folder)
    with refused("is no folder"):
        effects.add_folder(folder / "absent")
    assert os.environ["WINDWRENCH_EFFECTS"] == ""
    assert Path(effects._files()["rotor_drag"]).parent == Path(effects.__file__).parent
