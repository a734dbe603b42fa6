"""``check``: anyone's table in, by the command line."""

import json

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.outcomes import refused
from tests.support.random_tables import flight, random_table, save
from windwrench.cli import app
from windwrench.identification.logs.reading import read_log


@pytest.fixture(scope="module")
def written():
    return random_table(flight("ardrone2", "excite", 1, 12.0), default_rng(4), 0.0)


def run(capsys, *arguments):
    app([*map(str, arguments), "--json"], standalone_mode=False)
    return json.loads(capsys.readouterr().out)["result"]


def test_check_proposes_a_map_and_writes_the_log_by_it(tmp_path, written, capsys):
    theirs = save(written, tmp_path / "theirs.csv")
    map_file = tmp_path / "map.yaml"
    found = run(
        capsys, "check", theirs, "--vehicle", "ardrone2", "--write-map", map_file, "--out", tmp_path
    )
    assert found["read_by"] == "a map that was guessed"
    assert (tmp_path / "check.png").read_bytes().startswith(b"\x89PNG")
    assert found["map"] == map_file.read_text()
    assert all(field["why"] for field in found["fields"])
    ours = tmp_path / "ours.csv.gz"
    run(capsys, "check", theirs, "--map", map_file, "--write", ours, "--out", tmp_path / "by_map")
    again = read_log(ours)
    assert_allclose(again.position, written.log.position, atol=1e-9)
    assert again.vehicle == "ardrone2"


def test_commands_stay_commands_when_they_are_written(tmp_path, capsys):
    """What nobody measured must not come back as if it had been."""
    lines = ["time,x,y,z,roll,pitch,yaw,pwm1,pwm2,pwm3,pwm4"]
    lines += [f"{0.01 * k:.2f},0,0,1,0,0,0,1500,1500,1500,1500" for k in range(50)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    out = tmp_path / "b.csv"
    run(
        capsys, "check", tmp_path / "a.csv", "--map", "euler-pwm", "--vehicle", "crazyflie",
        "--write", out, "--out", tmp_path,
    )  # fmt: skip
    assert "cmd1" in out.read_text().split("\n")[0]
    assert "omega1" not in out.read_text().split("\n")[0]


def test_positions_without_an_attitude_are_a_channel_and_an_imu_is_checked(tmp_path, capsys):
    """Five positions a second beside an accelerometer that reads in g."""
    t = 0.01 * np.arange(1500)
    position = np.where(np.arange(1500)[:, None] % 20 == 0, np.sin(np.outer(t, [1, 2, 3])), np.nan)
    sensors = 0.01 * np.sin(np.outer(t, [3, 5, 7, 11, 13, 17])) + [0, 0, 1, 0, 0, 0]
    speeds = 376.0 + 5.0 * np.sin(np.outer(t, [7, 8, 9, 10]))
    names = "t,px,py,pz,ax,ay,az,gx,gy,gz,omega1,omega2,omega3,omega4"
    rows = np.column_stack([t, position, sensors, speeds])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=names, comments="")
    found = run(capsys, "check", tmp_path / "a.csv", "--vehicle", "ardrone2", "--out", tmp_path)
    assert found["channels"]["position"]["rate_hz"] == pytest.approx(5.0)
    assert any("ax, ay, az look like g" in text for text in found["doubts"])


def test_a_map_with_something_missing_is_written_and_finished_by_hand(tmp_path, capsys):
    """Four columns that do not move: nothing shows that they are rotors, or in which unit."""
    log = flight("ardrone2", "excite", 1, 12.0)
    path = tmp_path / "a.csv"
    map_file = tmp_path / "m"
    columns = [log.t, *log.position.T, *log.quaternion.T, *np.full((4, len(log.t)), 380.0)]
    names = "time,x,y,z,qw,qx,qy,qz,aft_1,aft_2,aft_3,aft_4"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="")
    chosen = ["check", path, "--out", tmp_path, "--write-map", map_file]
    with refused(r"rotors\.columns: no columns look like four motors.*edit"):
        run(capsys, *chosen)
    text = map_file.read_text()
    assert "columns: ['?', '?', '?', '?']" in text
    with refused(r"rotors\.columns is still \?; expected \[aft_1, aft_2, "):
        run(capsys, "check", path, "--map", map_file, "--out", tmp_path)
    map_file.write_text(text.replace("'?', '?', '?', '?'", "aft_1, aft_2, aft_3, aft_4"))
    found = run(capsys, "check", path, "--map", map_file, "--out", tmp_path)
    assert found["samples"] == len(log.t)


def test_the_map_that_is_printed_names_its_columns(tmp_path, written, capsys):
    app(
        ["check", str(save(written, tmp_path / "theirs.csv")), "--out", str(tmp_path)],
        standalone_mode=False,
    )
    assert written.log_map.position is not None
    first = written.log_map.position.columns[0]
    assert first in capsys.readouterr().out.split("columns:")[1]
