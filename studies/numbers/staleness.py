"""Pages beside the code that they speak of: which was changed later."""

import re
from dataclasses import dataclass
from pathlib import Path

from windwrench import __version__
from windwrench.runtime.provenance import git
from windwrench.studies.numbers.rendering import DOCS, PAGES

ROOT = DOCS.parent
MADE = re.compile(
    r"^Made by `(?P<command>[^`]+)`, windwrench (?P<version>\d[\w.]*?), commits? "
    r"(?P<commits>[\w, -]+)\.$",
    re.MULTILINE,
)
_NAMED = re.compile(r"`((?:[a-z_]+/)+[a-z_0-9]+\.py)`")
# what shows kept results: a test compares such a page with them, so it cannot make them older
_SHOWS = re.compile(r"(?:^|[/_])(?:page|pictures?|section)\.py$|_page\.py$|/__init__\.py$")
_COMMANDS = {  # what writes a page, where its name does not say so
    "trials": "studies/trials",
    "real-flights": "studies/measured_flights",
    "close-loop": "studies/closed_loop",
    "leaderboard": "studies/learning",
    "reproduce": "paper",
    "speed": "speed",
}


@dataclass(frozen=True)
class Remark:
    """Why a page may be out of date; it is a reason to look, not an error.

    Attributes:
        page: from the repository's root.
        why: in words.
    """

    page: str
    why: str


def remarks() -> list[Remark]:
    """Return a remark for each page whose sources changed after it, or which another version made.

    A page that a command made is compared at the commits that it states, another one at the last
    commit that changed it. Sources are the code of the command and the modules that the page names,
    but for those that only show kept results.
    """
    found = []
    for path in (ROOT / "README.md", *sorted(DOCS.rglob("*.md"))):
        page = path.relative_to(ROOT).as_posix()
        text = path.read_text(encoding="utf-8")
        named = set(_NAMED.findall(text))
        made = list(MADE.finditer(text))
        for match in made:
            if match["version"] != __version__:
                found.append(Remark(page, f"made by version {match['version']}"))
            since = match["commits"].split(", ")[-1]
            if since.endswith("-dirty"):
                found.append(Remark(page, f"made by code that no commit holds ({since})"))
            found += _changed(page, since.removesuffix("-dirty"), named | _code(match["command"]))
        if not made and named:
            found += _changed(page, git(ROOT, "log", "-1", "--format=%h", "--", page), named)
    return found


def missing_sources() -> list[Remark]:
    """Return a remark for each module that a page names and that is not there."""
    return [
        Remark(path.relative_to(ROOT).as_posix(), f"names {name}, which is not there")
        for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md")))
        for name in sorted(set(_NAMED.findall(path.read_text(encoding="utf-8"))))
        if not (ROOT / name).exists() and not name.startswith(("my_", "live/ros2"))
    ]


def _code(command: str) -> set[str]:
    """Return the folder of the code behind a command line."""
    if study := re.match(r"python -m studies\.(\w+)", command):
        return {f"studies/{study[1]}"}
    word = command.split()[1]
    return {_COMMANDS[word]} if word in _COMMANDS else set()


def _changed(page: str, since: str, sources: set[str]) -> list[Remark]:
    there = sorted(source for source in sources if (ROOT / source).exists())
    if not (since and there):
        return []
    later = git(ROOT, "log", "--format=", "--name-only", f"{since}..HEAD", "--", *there).split()
    if page.removeprefix("docs/").removesuffix(".md") in PAGES:
        later = [name for name in later if not _SHOWS.search(name)]
    names = ", ".join(sorted(set(later)))
    return [Remark(page, f"since {since} changed: {names}")] if later else []


def in_a_checkout(root: Path = ROOT) -> bool:
    """Return whether there is a history to ask."""
    return (root / ".git").exists()
