"""A copy of the checkout's own files."""

import shutil

from tests.support.paths import ROOT
from tests.support.programs import said


def copied(target, objects=False):
    """Copy what git tracks or would, or without git what is no environment; ``objects``: also what
    is compiled of the core, which is taken where its sources are the same.
    """
    if (ROOT / ".git").exists():
        names = said("git", "ls-files", "-co", "--exclude-standard", cwd=ROOT).splitlines()
    else:
        files = (path.relative_to(ROOT) for path in ROOT.rglob("*") if path.is_file())
        names = [str(path) for path in files if ".venv" not in path.parts]
    for name in names:
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_bytes((ROOT / name).read_bytes())
    if objects and (ROOT / "build/core").exists():
        shutil.copytree(ROOT / "build/core", target / "build/core")
