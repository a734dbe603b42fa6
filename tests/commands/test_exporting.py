"""The command export-c: its files, and what it refuses to replace or translate."""

import json

FILES = {"windwrench_filter.h", "windwrench_filter.c", "main.c", "CMakeLists.txt"}


def test_it_writes_the_files_and_says_what_they_are(call, tmp_path):
    out = tmp_path / "filter"
    code, text, _ = call(
        "export-c",
        *("--vehicle", "crazyflie", "--estimator", "ukf", "--policy", "sac-0"),
        *("--rate", 100, "--gate", 0, "--out", out, "--json"),
    )
    assert code == 0
    said = json.loads(text)["result"]
    assert said["period_s"] == 0.01
    assert said["effects"] == []
    assert {p.name for p in out.iterdir()} == FILES | {"run.json"}
    source = (out / "windwrench_filter.c").read_text()
    assert "--estimator ukf" in source
    assert "ww_policy" in source


def test_files_that_are_there_stay_unless_said_otherwise(call, tmp_path):
    mine = tmp_path / "main.c"
    mine.write_text("int mine;\n")
    code, _, err = call("export-c", "--vehicle", "ardrone2", "--out", tmp_path)
    assert code == 2
    assert "main.c" in err
    assert "--overwrite" in err
    assert [p.name for p in tmp_path.iterdir()] == ["main.c"]
    assert mine.read_text() == "int mine;\n"
    assert call("export-c", "--vehicle", "ardrone2", "--out", tmp_path, "--overwrite")[0] == 0
    assert "ww_init" in mine.read_text()


def test_declared_effects_are_in_it_unless_none_are_wanted(call, tmp_path):
    vehicle = tmp_path / "mine.yaml"
    text = "name: mine\nmass: 0.5\ninertia: [3e-3, 3e-3, 5e-3]\narm_l: 0.12\n"
    text += "k: [8e-6, 8e-6, 8e-6, 8e-6]\np: [2e-7, 2e-7, 2e-7, 2e-7]\neffects:\n"
    vehicle.write_text(text + "- {name: rotor_drag, coefficients: {kdx: 1.0e-4, kdy: 1.0e-4}}\n")
    for words, effects in (((), ["rotor_drag"]), (("--effects", "none"), [])):
        out = tmp_path / f"{len(effects)} effects"
        code, text, _ = call("export-c", "--vehicle", vehicle, *words, "--out", out, "--json")
        assert code == 0
        assert json.loads(text)["result"]["effects"] == effects
        source = (out / "windwrench_filter.c").read_text()
        assert ("effect_rotor_drag" in source) == bool(effects)
