"""Print what the tests passed with as a software bill of materials (CycloneDX 1.5, JSON).

``python .ci/sbom.py > sbom.cdx.json``: every package of ``constraints.txt`` in its tested version,
and the JavaScript library that reports carry. The same files give the same bytes. Licences are
those that the packages which are installed here state.
"""

import hashlib
import json
import re
import tomllib
import uuid
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
UPLOT = ROOT / "identification/report/uplot"


def tested_versions() -> list[tuple[str, str]]:
    """Return the names and versions in ``constraints.txt``."""
    found = []
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        line = line.partition("#")[0].strip()
        if line:
            pinned = re.fullmatch(r"([\w.-]+)==([\w.+!-]+)(?:\s*;.*)?", line)
            if pinned is None:
                raise SystemExit(f"constraints.txt: {line}: expected NAME==VERSION")
            found.append((pinned[1], pinned[2]))
    return found


def licences(name: str, version: str) -> list[dict[str, object]]:
    """Return the licence that an installed package of this version states, if it states one."""
    try:
        stated = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return []
    expression = stated.get("License-Expression")
    if stated["Version"] != version or not expression:
        return []
    return [{"expression": expression}]


def component(kind: str, name: str, version: str, **more: object) -> dict[str, object]:
    """Return a library by its package URL."""
    known = name.lower().replace("_", "-") if kind == "pypi" else name
    purl = f"pkg:{kind}/{known}@{version}"
    filled = {key: value for key, value in more.items() if value}
    return {"type": "library", "bom-ref": purl, "name": name, "version": version, "purl": purl} | (
        filled
    )


def uplot() -> dict[str, object]:
    """Return the plotting library that stands in the package."""
    script = (UPLOT / "uPlot.iife.min.js").read_bytes()
    version = re.search(rb"\(v([\d.]+)\)", script)
    if version is None:
        raise SystemExit("uPlot.iife.min.js: expected its version in the first line")
    return component(
        "npm",
        "uplot",
        version[1].decode(),
        licenses=[{"license": {"id": "MIT"}}],
        hashes=[{"alg": "SHA-256", "content": hashlib.sha256(script).hexdigest()}],
    )


def sbom() -> dict[str, object]:
    """Return the bill of materials."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    version = re.search(r'__version__ = "(.+)"', (ROOT / "__init__.py").read_text(encoding="utf-8"))
    if version is None:
        raise SystemExit("__init__.py: expected __version__")
    components = [
        component("pypi", name, number, licenses=licences(name, number))
        for name, number in tested_versions()
    ]
    components.append(uplot())
    identity = uuid.uuid5(uuid.NAMESPACE_OID, json.dumps(components, sort_keys=True))
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{identity}",
        "version": 1,
        "metadata": {
            "component": component(
                "pypi",
                project["name"],
                version[1],
                type="application",
                licenses=[{"license": {"id": project["license"]}}],
            )
        },
        "components": components,
    }


if __name__ == "__main__":
    print(json.dumps(sbom(), indent=1))
