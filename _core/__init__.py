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
    "avx512": {"avx512f", "avx512dq", "avx512bw", "avx512vl", "avx2", "fma"},
    "avx2": {"avx2", "fma"},
    "baseline": set[str](),
}
_HERE = Path(__file__).parent
if (_HERE.parent / "installation").is_dir():
    import_module("..installation.sources", __name__).build_changed()


def _flags() -> set[str]:
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text().splitlines() if listed.exists() else []
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


def _chosen() -> str:
    forced, flags = os.environ.get("WINDWRENCH_CORE"), _flags()
    found = [
        name
        for name, needed in _BUILDS.items()
        if needed <= flags and any((_HERE / (name + end)).exists() for end in EXTENSION_SUFFIXES)
    ]
    if forced not in (None, "", *found):
        raise ImportError(f"WINDWRENCH_CORE: {forced!r}: expected one of {', '.join(found)} here")
    if not found:
        raise ImportError(f"no compiled core in {_HERE}: expected `pip install .`")
    return forced or found[0]


_build = import_module(f".{_chosen()}", __name__)
globals().update({name: value for name, value in vars(_build).items() if name[0] != "_"})
