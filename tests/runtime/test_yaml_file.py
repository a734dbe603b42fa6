"""YAML of the kit and of its users: one loader, which refuses a key that comes twice."""

import ast

import pytest

from tests.support.outcomes import refused
from tests.support.paths import ROOT
from windwrench.commands.tuning_file import load_tuning
from windwrench.dynamics import load_vehicle
from windwrench.envs.scenarios import SCENARIOS, find_scenario
from windwrench.identification.logs.log_map import load_map
from windwrench.identification.logs.readers.rosbag import given_map
from windwrench.runtime.file_limits import LIMITS
from windwrench.runtime.yaml_file import parse_yaml
from windwrench.training.configuration import load_config

VEHICLE = (ROOT / "dynamics" / "vehicles" / "ardrone2.yaml").read_text(encoding="utf-8")
LOADERS = {
    "vehicle": (load_vehicle, VEHICLE + "rotor_radius: 0.2\n", "rotor_radius"),
    "scenario": (lambda path: find_scenario(str(path), SCENARIOS), "speed: 1\nspeed: 2\n", "speed"),
    "map": (load_map, "time: {column: t}\ntime: {column: u}\n", "time"),
    "topics": (given_map, "position: /a\nrotors: /b\nposition: /c\n", "position"),
    "tuning": (load_tuning, "force_walk: 1\nforce_walk: 2\n", "force_walk"),
    "training": (lambda path: load_config("sac", file=path), "steps: 1\nsteps: 2\n", "steps"),
}


@pytest.mark.parametrize("kind", LOADERS)
def test_a_key_twice_is_refused_with_file_key_and_both_lines(kind, tmp_path):
    load, text, key = LOADERS[kind]
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    bare = [line.partition("#")[0] for line in text.splitlines()]
    lines = [n for n, line in enumerate(bare, 1) for _ in range(line.count(f"{key}:"))]
    assert len(lines) == 2
    told = rf"mine\.yaml: .*key '{key}' comes twice, in lines {lines[0]} and {lines[1]}; expected"
    with refused(told):
        load(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a:\n  b: 1\n  c: 2\n  b: 3\n", "'b' comes twice, in lines 2 and 4"),
        ("a: 1\n'a': 2\n", "'a' comes twice, in lines 1 and 2"),
        ("yes: 1\ntrue: 2\n", "True comes twice, in lines 1 and 2"),
        ("16: 1\n0x10: 2\n", "16 comes twice, in lines 1 and 2"),
        ("<<: {a: 1}\n<<: {b: 2}\n", "'<<' comes twice, in lines 1 and 2"),
    ],
)
def test_keys_are_compared_by_value(text, told):
    with refused(f"text: not valid YAML: key {told}; expected once"):
        parse_yaml(text, "text")


def test_a_merged_mapping_may_be_overridden():
    text = "a: {b: &b {<<: &c {x: 1}, x: 2}}\nd: {<<: *b, x: 3}\ne: {<<: [*b, *c], y: 1}\n"
    found = parse_yaml(text, "text")
    assert found == {"a": {"b": {"x": 2}}, "d": {"x": 3}, "e": {"x": 2, "y": 1}}


def test_depth_counts_values_within_values():
    most = LIMITS.yaml_depth
    assert parse_yaml("[" * (most - 1) + "1" + "]" * (most - 1), "text")
    for depth in (most, 100_000):
        with refused(f"more than {most} deep"):
            parse_yaml("[" * depth + "1" + "]" * depth, "text")


def test_the_package_has_no_other_loader():
    loads = {"safe_load", "load", "full_load", "compose", "safe_load_all", "load_all"}
    found = []
    for path in ROOT.rglob("*.py"):
        room = path.relative_to(ROOT).parts[0]
        if room in ("tests", "build", "results") or room.startswith("."):
            continue
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "yaml." in text else ():
            if isinstance(node, ast.Attribute) and node.attr in loads:
                of = node.value
                found += [str(path)] * (isinstance(of, ast.Name) and of.id == "yaml")
    assert not found
