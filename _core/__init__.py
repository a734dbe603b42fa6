"""The compiled core: what is computed at every step.

One of its builds is chosen by the processor's instructions; ``WINDWRENCH_CORE=baseline``,
``avx2`` or ``avx512`` forces one. In a checkout this build is compiled first where it is missing or
a source was edited.
"""

import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

# builds, best first, with the processor's flags that each needs, as Linux writes them
_BUILDS = {
    "avx512": "fma avx2 avx512f avx512dq avx512bw avx512vl",
    "avx2": "fma avx2",
    "baseline": "",
}
_HERE = Path(__file__).parent


def _runnable(cpuinfo: str) -> list[str]:
    flags = {*cpuinfo.split()}
    return [name for name, needed in _BUILDS.items() if flags.issuperset(needed.split())]


def _found(names: list[str]) -> list[str]:
    return [name for name in names if find_spec(f".{name}", __name__)]


def _chosen(found: list[str], forced: str) -> str:
    if not found:
        raise ImportError(f"no compiled core in {_HERE}: expected `pip install .`")
    if forced and forced not in found:
        raise ImportError(f"WINDWRENCH_CORE: {forced!r}: expected one of {', '.join(found)} here")
    return forced or found[0]


_listed = Path("/proc/cpuinfo")
_names = _runnable(_listed.read_text() if _listed.exists() else "")
_forced = os.environ.get("WINDWRENCH_CORE", "")
if (_HERE.parent / "installation").is_dir():
    import_module("..installation.sources", __name__).build_changed(_chosen(_names, _forced))
_core = vars(import_module(f".{_chosen(_found(_names), _forced)}", __name__))
globals().update({name: value for name, value in _core.items() if name[0] != "_"})
