"""A C++ compiler: the user's choice, the system's, or the package ``ziglang``."""

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys

NAMES = ("c++", "g++", "clang++")
ZIG = "ziglang>=0.15"  # a requirement of the build where the system has no compiler
PROBE = "#include <cmath>\n#include <vector>\nint main() { return 0; }\n"


def system_compiler() -> list[str] | None:
    """Return the words that start ``$CXX`` or the first compiler on the path with a C++17
    library; none where both are missing.
    """
    if chosen := os.environ.get("CXX"):
        return shlex.split(chosen)
    for name in NAMES:
        if (path := shutil.which(name)) and compiles(path):
            return [path]
    return None


def compiles(path: str) -> bool:
    """Return whether a compiler finds the standard library: ``gcc`` alone comes without one."""
    words = [path, "-std=c++17", "-fsyntax-only", "-x", "c++", "-"]
    return subprocess.run(words, input=PROBE, text=True, capture_output=True).returncode == 0


def compiler() -> list[str]:
    """Return the words that start a compiler; raise ``SystemExit`` where there is none."""
    if found := system_compiler():
        return found
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "c++", "-target", zig_target()]
    raise SystemExit(
        f"no C++ compiler: expected $CXX, one of {', '.join(NAMES)}, or `pip install ziglang`"
    )


def zig_target() -> str:
    """Return zig's name of this machine, with the version of its C library.

    Without a target zig compiles for the processor at hand: a baseline would not be one.
    """
    machine = {"arm64": "aarch64", "amd64": "x86_64"}.get(
        platform.machine().lower(), platform.machine()
    )
    if sys.platform == "darwin":
        return f"{machine}-macos"
    name, version = platform.libc_ver()
    return f"{machine}-linux-gnu.{version}" if name == "glibc" else f"{machine}-linux-musl"
