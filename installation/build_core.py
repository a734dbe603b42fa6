"""The core as three extensions, one for each instruction set; setuptools calls it.

Each file of ``core/binding/units`` includes the binding's files that share templates and is
compiled once for each set. An object is compiled again when its source, one of the files that it
includes, the flags or the compiler have changed.
"""

import hashlib
import os
import platform
import re
import shlex
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

from compilers import compiler
from setuptools import Extension
from setuptools.command.build_ext import build_ext
from sources import ROOT, SOABI, built, digest

# names of the extensions, worst first, and flags of GCC, Clang and zig
AVX2 = ["-mavx2", "-mfma"]
SETS = {
    "baseline": [],
    "avx2": AVX2,
    "avx512": [*AVX2, "-mavx512f", "-mavx512dq", "-mavx512bw", "-mavx512vl"],
}
COMMON = ["-std=c++17", "-fPIC", "-fvisibility=hidden", "-DNDEBUG"]
# Results are the same to the bit in all sets: no contraction to fused operations, which GCC's
# pass over straight-line code makes in spite of the first flag
EXACT = ["-ffp-contract=off", "-fno-tree-slp-vectorize"]
FAST = ["-O3", "-fno-math-errno", "-fno-trapping-math"]
FLAGS = [*COMMON, *FAST, *EXACT, "-Wall", "-Wextra", "-Wno-psabi"]
# of nanobind itself, whose speed is that of a call
NANOBIND_FLAGS = [*COMMON, "-O2", "-fno-strict-aliasing"]
UNITS = sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob("core/binding/units/*.cpp"))


def sets(checkout: bool = False) -> list[str]:
    """Return the instruction sets to build: all of this platform for a wheel, in a checkout the
    set that this machine loads; ``$WINDWRENCH_CORE`` names another, or ``all``.
    """
    known = list(SETS)
    if not (sys.platform == "linux" and platform.machine() == "x86_64"):
        known = known[:1]
    chosen = os.environ.get("WINDWRENCH_CORE", "")
    if chosen in known:
        return [chosen]
    if chosen not in ("", "all"):
        expected = ", ".join([*known, "all"])
        raise SystemExit(f"WINDWRENCH_CORE: {chosen!r}: expected one of {expected}")
    return [best(known)] if checkout and not chosen else known


def best(names: list[str]) -> str:
    """Return the last of these sets whose instructions this machine has."""
    listed = Path("/proc/cpuinfo")
    flags = {f"-m{flag}" for flag in (listed.read_text().split() if listed.exists() else [])}
    return [name for name in names if flags.issuperset(SETS[name])][-1]


def extensions() -> list[Extension]:
    """Return setuptools' names for the extensions."""
    return [Extension(f"windwrench._core.{name}", UNITS, language="c++") for name in sets()]


class BuildCore(build_ext):
    """Compile and link the extensions with one compiler, as many objects at once as cores."""

    def run(self) -> None:
        """Build. A checkout gets the set that this machine loads, a third of the compiling, and
        notes of what sources. Another set follows when ``WINDWRENCH_CORE`` asks for it.
        """
        built_of = digest()
        names = sets(self.inplace)
        self.extensions = [e for e in self.extensions if e.name.rpartition(".")[2] in names]
        super().run()
        for name in names if self.inplace else []:
            built(name).write_text(built_of)

    def build_extensions(self) -> None:
        """Compile all objects side by side, then link each extension."""
        import nanobind

        found = Path(nanobind.__file__).parent
        words = compiler()
        includes = [sysconfig.get_path("include"), nanobind.include_dir()]
        includes.append(str(found / "ext/robin_map/include"))
        system = [word for path in includes for word in ("-isystem", path)]
        # flags of the user's own hold for the core; but contraction stays off
        machine = shlex.split(os.environ.get("ARCHFLAGS", ""))
        own = [*shlex.split(os.environ.get("CXXFLAGS", "")), *EXACT, *machine]
        folder = ROOT / "build/core" / str(SOABI)
        objects = Objects(words, folder, version("nanobind"))
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            shared = pool.submit(
                objects.compiled,
                Path(nanobind.source_dir()) / "nb_combined.cpp",
                "nanobind",
                [*NANOBIND_FLAGS, *system, *machine],
            )
            parts = []
            for extension in self.extensions:
                name = extension.name.rpartition(".")[2]
                flags = [*FLAGS, *SETS[name], f"-DWINDWRENCH_MODULE={name}"]
                flags += [f'-DWINDWRENCH_INSTRUCTION_SET="{name}"', *system, *own]
                parts += [
                    (extension, pool.submit(objects.compiled, Path(source), name, flags))
                    for source in extension.sources
                ]
            for extension in self.extensions:
                target = Path(self.get_ext_fullpath(extension.name))
                target.parent.mkdir(parents=True, exist_ok=True)
                compiled = [part.result() for of, part in parts if of is extension]
                objects.link([*compiled, shared.result()], target, own)


class Objects:
    """Compiled objects in a folder, each beside the digest of what it was compiled of.

    Args:
        words: The words that start the compiler.
        folder: The objects' folder; it outlives a build.
        nanobind: The version of nanobind.
    """

    def __init__(self, words: list[str], folder: Path, nanobind: str) -> None:
        self.words, self.folder = words, folder
        self.tools = f"{words} {done([*words, '--version'])} {nanobind} {sys.version}"

    def compiled(self, source: Path, name: str, flags: list[str]) -> Path:
        """Return a source's object, compiled where no object of the same content exists.

        The folders of system headers are left out of the digest: pip's change with each build.
        """
        target = self.folder / name / f"{source.stem}.o"
        key, listed = target.with_suffix(".key"), target.with_suffix(".d")
        known = [flag for at, flag in enumerate(flags) if "-isystem" not in flags[at - 1 : at + 1]]
        if (
            target.is_file()
            and key.is_file()
            and key.read_text() == self.key(source, listed, known)
        ):
            return target
        target.parent.mkdir(parents=True, exist_ok=True)
        key.unlink(missing_ok=True)
        words = [*flags, "-MMD", "-MF", str(listed), "-c", str(source), "-o", str(target)]
        done([*self.words, *words])
        key.write_text(self.key(source, listed, known))
        return target

    def key(self, source: Path, listed: Path, flags: list[str]) -> str:
        """Return the digest of compiler, flags, a source, and the files in it."""
        sha = hashlib.sha256(f"{self.tools} {flags}".encode())
        text = listed.read_text() if listed.is_file() else ""
        listed_files = re.split(r"\s+", text.replace("\\\n", " ").partition(": ")[2].strip())
        inside = sorted(name for name in listed_files if name.endswith((".hpp", ".cpp")))
        for path in [ROOT / source, *(ROOT / name for name in inside)]:
            sha.update(path.read_bytes() if path.is_file() else b"gone")
        return sha.hexdigest()

    def link(self, objects: list[Path], target: Path, flags: list[str]) -> None:
        """Link an extension, without symbols unless they are asked for."""
        how = ["-shared"]
        if sys.platform == "darwin":
            how = ["-bundle", "-undefined", "dynamic_lookup"]
        elif not any(flag.startswith("-g") for flag in flags):
            how += ["-Wl,-s"]
        done([*self.words, *how, *flags, *map(str, objects), "-o", str(target)])


def done(words: list[str]) -> str:
    """Return what the compiler prints in the checkout, where names of sources are relative; raise
    ``SystemExit`` with its errors where it fails.
    """
    ended = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    if ended.returncode:
        raise SystemExit(f"{shlex.join(words)}\n{ended.stdout}{ended.stderr}")
    sys.stderr.write(ended.stderr)
    return ended.stdout
