"""The notebooks run from top to bottom, say what their text says, and draw their picture."""

import re

import pytest

from tests.support.paths import ROOT

FOLDER = ROOT / "examples" / "notebooks"
MARKERS = re.compile(r"^# %%.*$", re.MULTILINE)


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Return what runs a notebook in an empty folder and returns its names."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    import matplotlib.pyplot as plt

    def run_one(name):
        names = {"__name__": "__main__"}
        path = FOLDER / f"{name}.py"
        exec(compile(path.read_text(encoding="utf-8"), path, "exec"), names)
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        return names

    yield run_one
    plt.close("all")


def test_every_notebook_is_in_the_table_the_gallery_and_these_tests():
    names = {path.stem for path in FOLDER.glob("*.py")}
    table = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    gallery = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert names == set(re.findall(r"\(notebooks/(\w+)\.py\)", table))
    assert names == set(re.findall(r"examples/notebooks/(\w+)\.py", gallery))
    assert names == {"estimator", "environment", "your_log"}


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_a_notebook_is_text_and_code_in_turn(path):
    text = path.read_text(encoding="utf-8")
    cells = MARKERS.findall(text)
    assert cells[0] == "# %% [markdown]"
    assert len(cells) >= 6
    for target in re.findall(r"\]\s*\(([^)]+)\)", text):
        assert (path.parent / target).exists(), target


def test_the_filter_finds_a_force_that_nobody_measures(run):
    names = run("estimator")
    true = names["flight"]["force"][names["settled"], 1].mean()
    assert 0.2 < true < 0.4
    for force in names["estimates"].values():
        assert force[names["settled"]].mean() == pytest.approx(true, abs=0.05)


def test_the_papers_law_stays_in_the_jet_and_hovering_does_not(run):
    rmse = run("environment")["rmse"]
    assert rmse["admittance"] < 0.3 * rmse["hover"]


@pytest.mark.slow  # a diagnosis names a drag in tests/identification, the other notebooks run here
def test_the_diagnosis_of_a_log_names_what_was_added(run):
    names = run("your_log")
    found = names["found"]
    assert [effect.name for effect in found.effects] == ["rotor_drag"]
    assert found.effects[0].coefficients["kdx"] == pytest.approx(1.2e-4, rel=0.1)
    assert found.after.force_rms < 0.5 * found.before.force_rms
