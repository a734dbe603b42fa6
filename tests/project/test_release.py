"""What describes the package for others says the same as the package."""

import json
import re
import tomllib

import yaml

import windwrench
from tests.support.paths import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"mujoco": "mujoco-python", "matplotlib": "matplotlib-base"}


def split(requirement):
    name, bound = re.fullmatch(r"([\w.-]+)(>=[\d.]+)", requirement).groups()
    return name.lower(), bound


def test_codemeta_says_what_the_project_says():
    data = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    assert data["name"] == PROJECT["name"]
    assert data["version"] == windwrench.__version__
    assert data["license"].endswith(f"/{PROJECT['license']}")
    assert set(PROJECT["keywords"]) <= set(data["keywords"])
    assert data["softwareRequirements"] == [split(r)[0] for r in PROJECT["dependencies"]]
    assert PROJECT["requires-python"] in data["runtimePlatform"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (cited["version"], cited["license"]) == (data["version"], PROJECT["license"])


def test_the_conda_recipe_needs_what_the_project_needs():
    text = (ROOT / "conda/meta.yaml").read_text(encoding="utf-8")
    recipe = yaml.safe_load(re.sub(r"{%.*?%}|{{.*?}}", "x", text).replace("x\n\n", "\n", 1))
    wanted = [" ".join((CONDA_NAMES.get(n, n), b)) for n, b in map(split, PROJECT["dependencies"])]
    assert recipe["requirements"]["run"] == [f"python {PROJECT['requires-python']}", *wanted]
    (build,) = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert " ".join(split(build)) in recipe["requirements"]["host"]
    (script,) = recipe["build"]["entry_points"]
    name, _, target = script.partition(" = ")
    assert PROJECT["scripts"] == {name: target}
