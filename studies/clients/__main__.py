"""``python -m studies.clients`` (``make clients``): install each library, train a little, tell."""

import argparse
import json
import os
import subprocess
import venv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from windwrench.runtime.whole_files import replaced

from .page import DATA, write_page

ROOT = Path(__file__).resolve().parents[2]
_EXAMPLES = ROOT / "examples" / "clients"
# by itself and first: a looser requirement could bring in a build with gigabytes of CUDA
_TORCH = ["torch==2.13.0"]


@dataclass(frozen=True)
class Client:
    """A library: what pip is told, a list a call, and what is then run, with the decisions."""

    name: str
    installed: tuple[list[str], ...]
    runs: tuple[list[str], ...]


CLIENTS = (
    Client("zoo", (_TORCH, ["rl_zoo3"]), (["zoo.py"],)),
    Client(
        "cleanrl",
        (
            _TORCH,
            ["stable-baselines3", "tensorboard"],
            ["--no-deps", "--ignore-requires-python", "cleanrl==1.2.0"],
        ),
        (["cleanrl_scripts.py", "sac"], ["cleanrl_scripts.py", "ppo"]),
    ),
    Client("rllib", (_TORCH, ["ray[rllib]"]), (["rllib_ppo.py"],)),
    Client("torchrl", (_TORCH, ["torchrl"]), (["torchrl_sac.py"],)),
)


def prepare(client: Client, work: Path) -> Path:
    """Return the Python of a client's own environment, made and filled if it is not there."""
    folder = work / client.name
    python = folder / "bin" / "python"
    if not (folder / ".ready").exists():
        print(f"{client.name}: installing", flush=True)
        venv.create(folder, with_pip=True, clear=True)
        own = ["-c", str(ROOT / "constraints.txt"), "-e", str(ROOT)]
        for wanted in (*client.installed, own):
            subprocess.run([python, "-m", "pip", "install", "--quiet", *wanted], check=True)
        (folder / ".ready").touch()
    return python


def run(python: Path, script: list[str], steps: int) -> dict[str, Any]:
    """Return what a client's script tells in its last line, or how it failed."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [python, *script, str(steps)],
        cwd=_EXAMPLES,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    lines = (done.stdout if done.returncode == 0 else done.stderr).strip().splitlines() or [""]
    if done.returncode:
        return {"client": " ".join(script), "failed": lines[-1]}
    told: dict[str, Any] = json.loads(lines[-1])
    return told | {"script": " ".join(script)}


def main() -> None:
    """Run every client, or those named; write results and page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, default=Path(".clients"), help="of the environments")
    parser.add_argument("--steps", type=int, default=3000, help="decisions of each")
    parser.add_argument("--only", nargs="*", choices=[client.name for client in CLIENTS])
    given = parser.parse_args()
    results: list[dict[str, Any]] = []
    work = given.work.absolute()
    for client in CLIENTS:
        if given.only and client.name not in given.only:
            continue
        python = prepare(client, work)
        for script in client.runs:
            results.append(run(python, script, given.steps))
            print(json.dumps(results[-1]), flush=True)
    if not given.only:
        with replaced(DATA) as partial:
            partial.write_text(json.dumps(results, separators=(",", ":")) + "\n", encoding="utf-8")
        write_page(results)
    if any("failed" in result for result in results):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
