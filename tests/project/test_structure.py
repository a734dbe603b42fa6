"""The house: a floor imports only from floors below it, and nothing goes round in a circle. Lazy
imports count.
"""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter

import pytest

from tests.support.paths import ROOT

PACKAGE = "windwrench"

# from the ground up; rooms of one floor do not know each other
FLOORS = (
    {"_core"},
    {"runtime"},
    {"dynamics"},
    {"estimator", "controllers"},
    {"envs", "identification"},
    {"evaluation", "live"},
    {"training", "reproduction", "demo"},
    {"evidence"},
    {"cli", "commands", "__main__"},
)
FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
# inside identification, from the ground up: arithmetic of series knows no log; what judges a log by
# the motion that it shows stands above that motion
STOREYS = (
    {"motion.smoothing"},
    {"logs"},
    {"motion"},
    {"logs.evidence", "logs.inertial"},
    {"logs.screening", "findings"},
    {"inertial_wrench"},
    {"wrench_series"},
    {"causal_states", "wind_profile", "jet_design"},
    {"profile_law"},
    {"prediction"},
    {"comparison", "vehicle_fit", "diagnosis"},
    {"report", "wrench_track"},
)
STOREY = {room: height for height, rooms in enumerate(STOREYS) for room in rooms}
TORCH = {"torch", "stable_baselines3", "sb3_contrib"}
MUJOCO_FREE = {"runtime", "dynamics", "estimator", "controllers", "identification"}
NOT_ROOMS = {"tests", "docs", "examples", "build", "results", "site", "installation", "setup"}


def sources(root=ROOT):
    """The package's files by the names of their modules: ``estimator.ukf``, and ``estimator`` for
    its ``__init__``.
    """
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        if (
            parts[0] in NOT_ROOMS
            or any(part.startswith(".") for part in parts)
            or parts == ("__init__",)
        ):
            continue
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def statements(path):
    """The import statements of a file, wherever in it they stand."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(module, path, modules):
    """Yield ``(line number, imported module)`` for each import statement of a file, wherever in it
    it stands.

    Modules of the package are named as in ``sources``, all others by their own whole names.
    """
    package = [PACKAGE, *module.split(".")]
    if path.stem != "__init__":
        package.pop()
    for node in statements(path):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.removeprefix(f"{PACKAGE}.")
        else:
            base = package[: len(package) - node.level + 1] if node.level else []
            whole = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                name = f"{whole}.{alias.name}".removeprefix(f"{PACKAGE}.")
                yield node.lineno, name if name in modules else whole.removeprefix(f"{PACKAGE}.")


def edges(modules):
    """Every import of one of the package's modules by another: ``(importer, line, imported)``."""
    return [
        (module, line, other)
        for module, path in modules.items()
        for line, other in imports(module, path, modules)
        if other in modules and other != module
    ]


def room(module):
    return module.partition(".")[0]


def storey(module):
    inside = module.split(".")[1:]
    return STOREY.get(".".join(inside[:2]), STOREY[inside[0]])


def line_of(modules, module, line):
    text = modules[module].read_text(encoding="utf-8").splitlines()[line - 1].strip()
    return f"{modules[module].name} of {module}, line {line}: {text}"


def upward(modules):
    """The lines that import from a floor that does not lie below; the front doors, ``__main__``,
    are above all.
    """
    return [
        line_of(modules, module, line)
        for module, line, other in edges(modules)
        if not module.endswith("__main__")
        and room(module) != room(other)
        and FLOOR[room(other)] >= FLOOR[room(module)]
        and not {room(module), room(other)} <= FLOORS[-1]
    ]


def circle(modules):
    """The modules of one circle of imports, the last the first again; none where there is none."""
    graph = {module: set() for module in modules}
    for module, _, other in edges(modules):
        graph[module].add(other)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


@pytest.fixture(scope="module")
def modules():
    return sources()


def test_every_room_has_its_floor(modules):
    assert {room(module) for module in modules} <= set(FLOOR)
    inside = {module.split(".")[1] for module in modules if module.startswith("identification.")}
    assert inside <= set(STOREY)


def test_floors_look_down(modules):
    assert not upward(modules), "\n".join(upward(modules))


def test_nothing_goes_round_in_a_circle(modules):
    assert not circle(modules), " <- ".join(circle(modules))


def test_identification_is_built_from_logs_upwards(modules):
    found = [
        line_of(modules, module, line)
        for module, line, other in edges(modules)
        if module.startswith("identification.") and other.startswith("identification.")
        if module.split(".")[1] != other.split(".")[1] and storey(other) >= storey(module)
    ]
    assert not found, "\n".join(found)


def test_who_knows_torch_and_mujoco(modules):
    """Torch is imported by training, and by evidence; MuJoCo by the simulation and what uses it."""
    found = [
        line_of(modules, module, line)
        for module, path in modules.items()
        for line, other in imports(module, path, modules)
        if (other.partition(".")[0] in TORCH and room(module) not in ("training", "evidence"))
        or (other.partition(".")[0] == "mujoco" and room(module) in MUJOCO_FREE)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("file", "before", "line"),
    [
        ("estimator/ukf.py", "def f():\n    ", "from ..envs import plant"),
        ("identification/prediction.py", "", "import windwrench.envs.fan"),
        ("evaluation/benchmark.py", "", "from ..training.train import train"),
        ("runtime/workers.py", "if TYPE_CHECKING:\n    ", "from ..dynamics import vehicle"),
    ],
)
def test_a_forbidden_import_is_seen_and_its_line_told(tmp_path, file, before, line):
    for other in ("envs/plant.py", "envs/fan.py", "training/train.py", "dynamics/vehicle.py"):
        (tmp_path / other).parent.mkdir(exist_ok=True)
        (tmp_path / other).write_text("")
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(f"{before}{line}\n")
    (told,) = upward(sources(tmp_path))
    assert told.endswith(line)


def test_a_circle_is_seen(tmp_path):
    (tmp_path / "envs").mkdir()
    (tmp_path / "envs" / "a.py").write_text("def f():\n    from .b import g\n")
    (tmp_path / "envs" / "b.py").write_text("from .a import f\n")
    assert sorted(set(circle(sources(tmp_path)))) == ["envs.a", "envs.b"]
