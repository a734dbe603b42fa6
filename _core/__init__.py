"""The compiled core: what is computed at every step.

One of its builds is chosen by the processor's instructions; ``WINDWRENCH_CORE=baseline``,
``avx2`` or ``avx512`` forces one. In a checkout an edited source is compiled first.
"""

import os
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

# builds, best first, with the processor's flags that each needs, as Linux writes them
_BUILDS = {
    "avx512": "fma avx2 avx512f avx512dq avx512bw avx512vl",
    "avx2": "fma avx2",
    "baseline": "",
}
_HERE = Path(__file__).parent


def _flags() -> str:
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text().splitlines() if listed.exists() else []
    return next((line for line in lines if line.startswith("flags")), "")


def _found(flags: str, here: Path = _HERE) -> list[str]:
    return [
        name
        for name, needed in _BUILDS.items()
        if {*needed.split()} <= {*flags.split()}
        and any((here / (name + end)).exists() for end in EXTENSION_SUFFIXES)
    ]


def _chosen(found: list[str], forced: str) -> str:
    if not found:
        raise ImportError(f"no compiled core in {_HERE}: expected `pip install .`")
    if forced and forced not in found:
        raise ImportError(f"WINDWRENCH_CORE: {forced!r}: expected one of {', '.join(found)} here")
    return forced or found[0]


if (_HERE.parent / "installation").is_dir():
    import_module("..installation.sources", __name__).build_changed()
_name = _chosen(_found(_flags()), os.environ.get("WINDWRENCH_CORE", ""))
_core = vars(import_module(f".{_name}", __name__))
globals().update({name: value for name, value in _core.items() if name[0] != "_"})
