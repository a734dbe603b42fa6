"""What describes the package, what Python shows of it, and what is kept of results: little, in one
form each, shown by a page that says what made it.
"""

import dataclasses
import inspect
import re
import tomllib
from importlib import import_module

import numpy as np
import pytest
import yaml

import windwrench
from tests.support.diagnoses import made_diagnosis, made_trace
from tests.support.paths import ROOT
from tests.support.programs import said
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench.dynamics import EffectSetting, Mocap, Vehicle
from windwrench.dynamics.effects.base import Coefficient, Effect
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.estimator import (
    NoiseFit,
    NoiseFitSettings,
    Recovery,
    TimedFilter,
    UKFTuning,
    WrenchUKF,
    WrenchUKFBatch,
)
from windwrench.identification import FlightLog
from windwrench.reproduction import ObserverTuning

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_citation_says_what_the_project_says():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["license"] == PROJECT["license"].partition(" AND ")[0]  # the kit's own
    assert cited["version"] == windwrench.__version__
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"version = {{{windwrench.__version__}}}" in readme
    assert f"title = {{{cited['title']}}}" in readme


def test_the_wheel_names_every_licence_of_what_it_holds():
    if not (ROOT / ".git").exists():
        pytest.skip("needs a checkout: licences are those that git tracks")
    listed = set(PROJECT["license-files"])
    names = git("ls-files", "*LICENSE").split()
    assert {name for name in names if not name.startswith("tests/")} == listed
    page = (ROOT / "docs/release.md").read_text(encoding="utf-8")
    assert [name for name in listed - {"LICENSE"} if name not in page] == []


def test_each_missing_library_is_in_the_extra_that_is_named():
    text = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob("[a-z]*/**/*.py"))
    asked = re.findall(r'\bneed\(\s*"(\w+)", "(\w+)"', text)
    extras = str(PROJECT["optional-dependencies"]).replace("-", "_")
    assert [p for p in asked if re.search("'{1}': [^]]*{0}".format(*p), extras)] == asked != []


MOST = 5_400_000  # bytes, of all that git keeps of docs/ beside its films
MOST_OF_FILMS = 3_000_000  # bytes, of these: a reader of README waits for them
PICTURES = {".png", ".gif", ".jpg", ".webp", ".mp4", ".svg"}
MADE = re.compile(
    r"^Made by `(?:windwrench|python -m evidence\.)[^`]+`, "
    r"windwrench \d[\w.]*, commits? ([0-9a-f, ]+)\.$",
    re.M,
)


def git(*words):
    return said("git", *words, cwd=ROOT)


@pytest.fixture(scope="module")
def tracked():
    """What git keeps of docs/, and what lies there that it does not ignore."""
    if not (ROOT / ".git").exists():
        pytest.skip("needs a checkout: what is kept is what git tracks")
    names = git("ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", "docs")
    return [path for name in names.split("\0") if name and (path := ROOT / name).is_file()]


def test_docs_are_small(tracked):
    films = {path: path.stat().st_size for path in tracked if path.suffix == ".gif"}
    others = {path: path.stat().st_size for path in tracked if path not in films}
    for sizes, most in ((others, MOST), (films, MOST_OF_FILMS)):
        largest = sorted(sizes, key=sizes.__getitem__, reverse=True)[:5]
        assert sum(sizes.values()) <= most, [f"{p.name}: {sizes[p]}" for p in largest]


def test_a_figure_is_kept_once(tracked):
    pictures = [path for path in tracked if path.suffix in PICTURES]
    kept = [path.with_suffix("").as_posix() for path in pictures]
    assert len(kept) == len(set(kept))
    contents = [path.read_bytes() for path in pictures]
    assert len(contents) == len(set(contents))
    assert {path.suffix for path in pictures} <= {".png", ".gif"}


def test_every_picture_and_data_file_is_used(tracked):
    """By a page or README with its name."""
    pages = [ROOT / "README.md", *(path for path in tracked if path.suffix == ".md")]
    linked = {
        (page.parent / target).resolve()
        for page in pages
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
        if "://" not in target
    }
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    linked |= {ROOT / "docs" / name for name in re.findall(r"[\w/]+\.css", site)}
    unused = [
        path.relative_to(ROOT).as_posix()
        for path in tracked
        if path.suffix not in (".md", ".py", ".bib") and path not in linked
    ]
    assert not unused
    assert all(path.exists() for path in linked if path.suffix == ".png")


def test_pages_say_the_commits_that_made_them(tracked):
    pages = [path for path in tracked if path.suffix == ".md"]
    made = {path.name: MADE.findall(path.read_text(encoding="utf-8")) for path in pages}
    assert {name for name, commits in made.items() if commits} >= {"reproduction.md", "trust.md"}
    if git("rev-parse", "--is-shallow-repository").strip() == "true":
        pytest.skip("a shallow clone does not have the commits")
    named = {one for found in made.values() for line in found for one in line.split(", ")}
    for commit in named:
        git("merge-base", "--is-ancestor", commit, "HEAD")


DOCUMENTED = (
    *(Coefficient, Effect, EffectSetting, Mocap, MotorCurve, Vehicle),
    *(NoiseFit, NoiseFitSettings, ObserverTuning, Recovery),
    *(UKFTuning, FlightLog),
)


@pytest.mark.parametrize("kind", DOCUMENTED, ids=lambda kind: kind.__name__)
def test_help_says_what_each_field_is(kind):
    text = inspect.getdoc(kind)
    if kind is Vehicle:
        assert "mass: kg." in text
    described = set(re.findall(r"^ {4}(\w+): \S", text.split("Attributes:")[1], re.MULTILINE))
    own = [f for f in dataclasses.fields(kind) if f.name in kind.__annotations__]
    assert {f.name for f in own} - described == set()


def filters():
    ukf = WrenchUKF(VEHICLE)
    ukf.reset(*POSE)
    batch = WrenchUKFBatch(VEHICLE, 2)
    batch.reset(*POSE)
    return ukf, batch


def test_repr_is_short_and_says_what_it_is():
    ukf, batch = filters()
    assert repr(ukf) == "<WrenchUKF of ardrone2: period 0.005 s, tracking>"
    assert repr(batch) == "<WrenchUKFBatch of 2 x ardrone2: period 0.005 s>"
    estimate = ukf.step(HOVER, *POSE)
    assert repr(estimate).startswith("<WrenchEstimate tracking: force (")
    assert " Nm, NIS " in repr(estimate)
    assert "coasting" in repr(ukf.step(HOVER))
    assert repr(batch.step(np.tile(HOVER, (2, 1)))) == "<WrenchEstimate of 2: 2 coasting>"
    assert "0 late, 0 too late: <WrenchUKF" in repr(TimedFilter(ukf))
    made = made_diagnosis(made_trace(5.0))
    log = FlightLog(np.arange(3.0), np.zeros((3, 3)), np.tile(POSE[1], (3, 1)), np.ones((3, 4)))
    for thing, words in (
        (VEHICLE, "<Vehicle ardrone2: 0.465 kg, arm 0.126"),
        (made, "<Diagnosis explained: rotor_drag; force error "),
        (made.traces[0], "Trace(log='flight', period=0.04)"),
        (made.signatures[0], "Signature(effect='rotor_drag', channel='Fx', regressor="),
        (log, "<FlightLog without a name: 3 samples, 0 to 2 s>"),
    ):
        assert repr(thing).startswith(words)
        assert len(repr(thing)) < 160


@pytest.mark.parametrize(
    "package",
    ["", ".controllers", ".dynamics", ".envs", ".estimator", ".identification", ".reproduction"],
)
def test_a_prompt_shows_public_names_and_their_short_types(package):
    module = import_module(f"windwrench{package}")
    assert dir(module) == sorted(module.__all__)
    for name in dir(module):
        kind = getattr(module, name)
        for function in (kind, *vars(kind).values()) if inspect.isclass(kind) else (kind,):
            if inspect.isfunction(function) and not function.__name__.startswith("__"):
                assert len(str(inspect.signature(function))) < 400, (name, function)
