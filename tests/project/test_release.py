"""What describes the package says the same as the package; what is kept of results is little, in
one form each, shown by a page that says what made it.
"""

import json
import re
import tomllib

import pytest
import yaml

import windwrench
from tests.support.paths import ROOT
from tests.support.programs import said

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


MOST = 5_400_000  # bytes, of all that git keeps of docs/ beside its films
MOST_OF_FILMS = 3_000_000  # bytes, of these: a reader of README waits for them
PICTURES = {".png", ".gif", ".jpg", ".webp", ".mp4", ".svg"}
PAGES_OF_COMMANDS = (  # a line that says how the page was made, once or once a section
    "reproduction.md",
    "leaderboard.md",
    "speed.md",
    "trust.md",
    "identify.md",
    "tutorials/live.md",
)
MADE = re.compile(
    r"^Made by `(?:windwrench|python -m studies\.)[^`]+`, "
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
        if path.suffix not in (".md", ".py") and path not in linked
    ]
    assert not unused


@pytest.mark.parametrize("name", PAGES_OF_COMMANDS)
def test_a_page_says_the_commit_that_made_it(tracked, name):
    found = MADE.findall((ROOT / "docs" / name).read_text(encoding="utf-8"))
    assert found
    if git("rev-parse", "--is-shallow-repository").strip() == "true":
        pytest.skip("a shallow clone does not have the commits")
    for commit in {one for line in found for one in line.split(", ")}:
        git("merge-base", "--is-ancestor", commit, "HEAD")


def test_every_page_with_a_command_s_line_is_listed(tracked):
    pages = [path for path in tracked if path.suffix == ".md"]
    made = {
        path.relative_to(ROOT / "docs").as_posix()
        for path in pages
        if MADE.search(path.read_text(encoding="utf-8"))
    }
    assert made == set(PAGES_OF_COMMANDS)
