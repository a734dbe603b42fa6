"""Counts of size and language, each under a ceiling of ``ceilings.yaml``. A ceiling only falls.

``python .ci/counters.py`` prints all counts and fails above a ceiling, or where a ceiling is higher
than in any commit before. ``--lower`` writes the counts of today as ceilings where they are lower.
"""

import ast
import collections
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Callable, Iterator
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent
CEILINGS = ROOT / ".ci/ceilings.yaml"
# outside the wheel
CHECKOUT = ("tests", "evidence", "reproduction", "examples", "docs", ".ci")
NOT_KIT = (*CHECKOUT, "installation", "setup.py")
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
HAS_GIT = (ROOT / ".git").exists()
BUILT = (".venv", ".venv-ci", "build", "dist", "results", "site")
LONG = 25  # words
LANDED = ("--first-parent", "--format=%H")  # of git log: what was landed, newest first
SUBJECT = 72  # characters of a commit's first line
# the modules that a flight log passes until it is read
READING = """
import sys
passed = set()
def note(frame, event, argument):
    if event == "call":
        passed.add(frame.f_globals.get("__name__", ""))
from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.example import example_flight
from windwrench.identification.logs.reading import read_log
with example_flight() as example:
    vehicle = load_vehicle(example.vehicle)
    sys.setprofile(note)
    read_log(example.log, vehicle=vehicle)
    sys.setprofile(None)
print(sum(name.startswith("windwrench.") for name in passed))
"""


def sources() -> dict[str, str]:
    """Return the text of each Python file that git tracks; without git, of each file outside
    environments.
    """
    if HAS_GIT:
        paths = [ROOT / name for name in git("ls-files", "-co", "--exclude-standard").split("\n")]
    else:
        paths = [p for p in ROOT.rglob("*.py") if p.relative_to(ROOT).parts[0] not in BUILT]
    return {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for path in paths
        if path.suffix == ".py" and path.exists()
    }


def git(*words: str) -> str:
    """Return what a git command prints."""
    return subprocess.run(
        ["git", *words], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def texts(source: str) -> Iterator[str]:
    """Yield docstrings, blocks of comment lines, and comments behind code of a file."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.Module, *DEFINITIONS)) and (text := ast.get_docstring(node)):
            yield text
    block: list[str] = []
    last = -1
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            behind_code = bool(token.line[: token.start[1]].strip())
            if block and (behind_code or token.start[0] != last + 1):
                yield "\n".join(block)
                block = []
            block.append(token.string.lstrip("#").strip())
            last = -1 if behind_code else token.start[0]
    yield "\n".join(block)


def language(kit: dict[str, str]) -> dict[str, float]:
    """Return three counts over the sentences of docstrings and comments; a sentence ends with one
    of ``. ! ? :`` or an empty line and has three words or more.
    """
    parts = [
        part
        for source in kit.values()
        for text in texts(source)
        for part in re.split(r"(?<=[.!?:])\s+|\n\s*\n", text)
    ]
    sentences = [part for part in parts if len(re.findall(r"[A-Za-z']+", part)) > 2]
    pronouns = r"\b(that|which|what|those|it|who|whose)\b"
    begin = [s for s in sentences if re.match(r"\W*(of|where|what|by)\b", s, re.I)]
    long = [s for s in sentences if len(re.findall(r"[A-Za-z']+", s)) > LONG]
    words = sum(len(re.findall(pronouns, sentence, re.I)) for sentence in sentences)
    return {
        "that, which, what, those, it, who, whose: a sentence": round(words / len(sentences), 3),
        "sentences that begin with of, where, what, by: %": percent(begin, sentences),
        f"sentences over {LONG} words: %": percent(long, sentences),
    }


def percent(some: list[str], all_of_them: list[str]) -> float:
    """Return a share in per cent."""
    return round(100.0 * len(some) / len(all_of_them), 1)


def count() -> dict[str, float]:
    """Return all counts by name."""
    files = sources()
    trees = {name: ast.parse(text) for name, text in files.items()}
    nodes: collections.Counter[str] = collections.Counter()
    for name, tree in trees.items():
        own = "/" in name or name in NOT_KIT
        nodes[name.partition("/")[0] if own else "front"] += sum(1 for _ in ast.walk(tree))
    kit = {name: text for name, text in files.items() if name.partition("/")[0] not in NOT_KIT}
    inside = [node for name in kit for node in ast.walk(trees[name])]
    classes = collections.Counter(n.name for n in inside if isinstance(n, ast.ClassDef))
    public = [
        node
        for name in kit
        for node in trees[name].body
        if isinstance(node, DEFINITIONS) and not node.name.startswith("_")
    ]
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    rooms = sorted(room for room in nodes if room not in NOT_KIT)
    return {
        **{f"nodes of {room}": nodes[room] for room in rooms},
        "nodes of the kit": sum(nodes[room] for room in rooms),
        "nodes of tests": nodes["tests"],
        **language(kit),
        "class names used twice": sum(number > 1 for number in classes.values()),
        "public names": len(public),
        "modules that reading a log passes": int(run(READING)),
        "pages": len(pages),
        "words on pages": sum(len(page.read_text(encoding="utf-8").split()) for page in pages),
    }


def run(program: str) -> str:
    """Return what a program of Python prints."""
    words = [sys.executable, "-c", program]
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def earlier_ceilings() -> dict[str, float]:
    """Return the lowest ceiling of each name in what was landed before."""
    lowest: dict[str, float] = {}
    if not HAS_GIT:
        return lowest
    path = CEILINGS.relative_to(ROOT).as_posix()
    for commit in git("log", *LANDED, "--diff-filter=AM", "--", path).split():
        for name, value in yaml.safe_load(git("show", f"{commit}:{path}")).items():
            lowest[name] = min(value, lowest.get(name, value))
    return lowest


def problems(counts: dict[str, float], ceilings: dict[str, float]) -> Iterator[str]:
    """Yield one line for each count without a ceiling or above, and each ceiling that rose."""
    for name, value in counts.items():
        if name not in ceilings:
            yield f"{name}: {value:g} has no ceiling"
        elif value > ceilings[name]:
            yield f"{name}: {value:g}, expected at most {ceilings[name]:g}"
    for name, value in earlier_ceilings().items():
        if name in counts and ceilings.get(name, value) > value:
            yield f"{name}: the ceiling rose from {value:g} to {ceilings[name]:g}"


def bad_commits() -> Iterator[str]:
    """Yield one line for each commit since the first ceilings whose message lacks something."""
    if not HAS_GIT:
        return
    path = CEILINGS.relative_to(ROOT).as_posix()
    first = git("log", *LANDED, "--diff-filter=A", "--", path).split()[-1:]
    commits = f"{first[0]}..HEAD" if first else "HEAD..HEAD"
    messages = git("log", "--no-merges", "--format=%h%x00%s%x00%b%x01", commits)
    for entry in messages.split("\x01")[:-1]:
        commit, subject, body = entry.strip("\n").split("\x00")
        if not is_good_message(subject, body):
            expected = f"'scope: change', {SUBJECT} characters at most, and a body with the reason"
            yield f"commit {commit}: {subject!r}: expected {expected}"


def is_good_message(subject: str, body: str) -> bool:
    """Return whether a commit's subject has a scope and fits, and its body says the reason."""
    return bool(
        re.match(r"[a-z][\w ,-]*: \S", subject) and len(subject) <= SUBJECT and body.strip()
    )


def main(counted: Callable[[], dict[str, float]] = count) -> int:
    """Print all counts; return 1 where a ceiling does not hold, else 0."""
    ceilings = yaml.safe_load(CEILINGS.read_text(encoding="utf-8")) if CEILINGS.exists() else {}
    counts = counted()
    if "--lower" in sys.argv[1:]:
        ceilings = {n: min(value, ceilings.get(n, value)) for n, value in counts.items()}
        CEILINGS.write_text(yaml.safe_dump(ceilings, sort_keys=False), encoding="utf-8")
    for name, value in counts.items():
        print(f"{value:>10g}  of {ceilings.get(name, value):>8g}  {name}")
    errors = [*problems(counts, ceilings), *bad_commits()]
    for error in errors:
        print(f"error: {error}", file=sys.stderr)
    return int(bool(errors))


if __name__ == "__main__":
    sys.exit(main())
