"""Every threshold of the inference is a documented field of its module's settings."""

import ast
from pathlib import Path

import pytest

import windwrench.identification as room

ROOT = Path(room.__file__).parent
MODULES = [
    *sorted((ROOT / "inference").glob("*.py")),
    ROOT / "diagnosis.py",
    ROOT / "findings.py",
    ROOT / "prediction.py",
]


def numbers(tree: ast.AST) -> list[ast.Constant]:
    """Return the numeric literals in a part of a module; the shapes of a ``np.dtype`` are none."""
    if isinstance(tree, ast.Call) and ast.unparse(tree.func) == "np.dtype":
        return []
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, (int, float, complex))
        and not isinstance(node.value, bool)
    ]


def loose_thresholds(source: str) -> list[str]:
    """Return the module-level constants of a source that are made of numbers."""
    found = []
    for node in ast.parse(source).body:
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value and numbers(node.value):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found += [ast.unparse(target) for target in targets]
    return found


def undocumented_fields(source: str) -> list[str]:
    """Return the fields of settings that no comment explains."""
    lines, found = source.splitlines(), []
    for node in ast.parse(source).body:
        if isinstance(node, ast.ClassDef) and node.name.endswith(("Settings", "Cutoffs")):
            explained = False
            for part in node.body:
                if isinstance(part, ast.AnnAssign):
                    text = "\n".join(lines[part.lineno - 2 : part.end_lineno])
                    # a comment above several fields explains them all
                    explained = "#" in text or (explained and "#" not in lines[part.lineno - 2])
                    if not explained:
                        found.append(f"{node.name}.{ast.unparse(part.target)}")
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_numbers_are_fields_of_settings(path):
    source = path.read_text(encoding="utf-8")
    assert loose_thresholds(source) == []
    assert undocumented_fields(source) == []


def test_a_loose_threshold_is_found():
    assert loose_thresholds("LEAST = 4.0") == ["LEAST"]
    assert loose_thresholds("_A, _B = 1, 2.0") == ["(_A, _B)"]
    assert loose_thresholds("GRID: list = [-1.0]") == ["GRID"]
    assert loose_thresholds('SETTINGS = Settings()\nNAME = "x"\nFLAG = True\nA = SETTINGS.a') == []
    bare = "class Settings:\n    a: float = 1.0\n"
    assert undocumented_fields(bare) == ["Settings.a"]
    assert undocumented_fields(bare.replace("1.0", "1.0  # s")) == []
