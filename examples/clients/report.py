"""The last line that each client prints: one JSON object, from which the table is made."""

import json
import os
import platform
from importlib.metadata import version


def report(client, libraries, steps, run, shims=()):
    """Run a client and print what came of it.

    Args:
        client: its name.
        libraries: whose versions are told.
        steps: decisions that it was told to make.
        run: returns the returns of its training episodes, in order.
        shims: what it needed beyond its own interface, in words.
    """
    began = sum(os.times()[:4])  # of programs that it starts, too
    returns = run()
    told = {
        "client": client,
        "versions": {name: version(name) for name in libraries},
        "python": platform.python_version(),
        "decisions": steps,
        "episodes": len(returns),
        "first": sum(returns[:4]) / max(len(returns[:4]), 1),
        "last": sum(returns[-4:]) / max(len(returns[-4:]), 1),
        "cpu_s": round(sum(os.times()[:4]) - began, 1),
        "shims": list(shims),
    }
    print(json.dumps(told))
