"""What describes the package for others says the same as the package."""

import json
import re
import subprocess
import sys
import tomllib

import pytest
import yaml

import windwrench
from tests.support.paths import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"mujoco": "mujoco-python", "matplotlib": "matplotlib-base"}
SECTIONS = (  # that the Journal of Open Source Software asks for
    "Summary",
    "Statement of need",
    "State of the field",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "References",
)


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


def test_the_paper_has_its_sections_and_references():
    text = (ROOT / "paper.md").read_text(encoding="utf-8")
    heads = re.findall(r"^# (.+)$", text, re.MULTILINE)
    assert [head for head in heads if head in SECTIONS] == list(SECTIONS)
    cited = set(re.findall(r"@(\w+)", text))
    known = set(re.findall(r"^@\w+{(\w+),", (ROOT / "paper.bib").read_text("utf-8"), re.MULTILINE))
    assert cited == known


def test_the_papers_figures_are_those_of_the_pages():
    text = " ".join((ROOT / "paper.md").read_text(encoding="utf-8").split())
    rows = json.loads((ROOT / "docs/results/leaderboard.json").read_text(encoding="utf-8"))
    base = {row["controller"]: row for row in rows if row["scenario"] == "base"}
    for name in ("admittance", "hover", "oracle"):
        low, high = base[name]["rmse_ci95_m"]
        assert f"{base[name]['rmse_m']:.3f} m" in text
        assert f"({low:.3f} to {high:.3f})" in text
    trials = (ROOT / "docs/trust.md").read_text(encoding="utf-8")
    for count in re.findall(r"\d+ of \d+", text):
        assert count in trials, count
    assert "112 of 118 coefficients" in trials
    assert trials.count("(46 of 46 kinds) | 92 |") == 2  # 184 diagnoses


@pytest.fixture(scope="module")
def bill():
    done = subprocess.run(
        [sys.executable, ROOT / ".ci/sbom.py"], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def test_the_bill_of_materials_lists_every_tested_version(bill):
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.5")
    listed = {(c["name"], c["version"]) for c in bill["components"]}
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    tested = {tuple(line.split(";")[0].strip().split("==")) for line in lines if "==" in line}
    assert listed == tested | {("uplot", "1.6.32")}
    references = [c["bom-ref"] for c in bill["components"]]
    assert len(references) == len(set(references))
    assert bill["metadata"]["component"]["version"] == windwrench.__version__
