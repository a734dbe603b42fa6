"""Spoiled inputs: read, or refused with a message that names them; nothing runs, hangs, grows or is
written.
"""

import gzip
import pickle
import random
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.forms import Form, forms, lay_out
from tests.fuzz.mutations import LAUGHS, TOKENS
from tests.fuzz.run import attempt, fuzz, fuzz_chunk, run_command, spoiled, table
from tests.support.paths import ROOT
from windwrench.controllers.trained_policy import load_policy
from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.effects import names, parse_setting
from windwrench.dynamics.vehicle_file import parse_vehicle
from windwrench.envs.scenarios import get_scenario
from windwrench.estimator import UKFTuning
from windwrench.identification.logs import tables as files
from windwrench.identification.logs.reading import read_log
from windwrench.runtime.yaml_file import LARGEST, parse_yaml, read_yaml

FORMS = forms()
INPUTS = 30  # of each form, here; the command spoils 20,000

plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=20)
    | st.dates()
    | st.binary(max_size=8),
    lambda parts: (
        st.lists(parts, max_size=4)
        | st.dictionaries(st.text(max_size=8) | st.integers(), parts, max_size=4)
    ),
    max_leaves=12,
)
FIELDS = (
    "name",
    "mass",
    "inertia",
    "arm_l",
    "k",
    "p",
    "spin",
    "rotor_positions",
    "com",
    "omega_lsb",
    "omega_max",
    "floor_z",
    "ceiling_z",
    "mocap",
    "effects",
    "omega_source",
    "voltage_ref",
    "gravity",
    "rotor_radius",
    "thing",
)
GOOD = yaml.safe_load((ROOT / "dynamics" / "vehicles" / "ardrone2.yaml").read_text())


def taken_or_refused(words, call, *arguments):
    """Return what a call makes of its input, or None where it refuses it in a message with these
    words.
    """
    said = None
    try:
        return call(*arguments)
    except InputError as error:
        said = str(error)
    assert said.strip()
    assert words in said
    return None


@pytest.mark.parametrize("name", FORMS)
def test_spoiled_inputs_are_read_or_refused(name):
    tally = fuzz_chunk(name, 0, INPUTS, seed=1)
    assert tally.faults == []
    assert tally.inputs == INPUTS
    assert tally.refused > 0


@pytest.mark.parametrize("name", FORMS)
def test_what_is_spoiled_was_good(name, tmp_path):
    form = FORMS[name]
    assert attempt(form, lay_out(form, form.good(), tmp_path / "input"), longest=900.0) == (
        "read",
        "",
    )
    assert spoiled(form, 3, seed=5) == spoiled(form, 3, seed=5)
    assert len({spoiled(form, i, seed=5) for i in range(20)}) > 5


def test_the_fuzzer_sees_faults(tmp_path):
    def use(path):
        how = path.read_text()
        if how == "trips":
            return 1 / 0
        if how == "hangs":
            while True:
                pass
        if how == "overflows":
            return np.float64(1e308) * 10
        raise InputError("something is wrong")

    form = Form("bad", "f.txt", lambda: b"", (), use, ("estimate",))
    said = {
        how: attempt(form, lay_out(form, how.encode(), tmp_path / "input"), longest=0.2)
        for how in ("trips", "hangs", "overflows", "silent")
    }
    assert [kind for kind, _ in said.values()] == ["fault"] * 4
    assert "ZeroDivisionError" in said["trips"][1]
    assert "more than 0.2 s" in said["hangs"][1]
    assert "overflow" in said["overflows"][1]
    assert "does not name the file" in said["silent"][1]
    good = FORMS["CSV"]
    path = lay_out(good, good.good(), tmp_path / "input")
    assert "exit code 0" in run_command(good, path).replace("None", "0")  # a good log is no refusal


@pytest.mark.slow
def test_the_outcome_does_not_depend_on_processes():
    one, two = (fuzz(30, 3, jobs, only=("effect settings", "names")) for jobs in (1, 2))
    for a, b in zip(one, two, strict=True):
        assert (a.form, a.read, a.refused, a.faults, a.messages) == (
            b.form,
            b.read,
            b.refused,
            b.faults,
            b.messages,
        )
    assert "| all | 30 |" in table(one)


@settings(deadline=None)
@given(
    st.text(max_size=60)
    | st.builds(lambda n, t: f"{n}:{t}", st.sampled_from(names()), st.text(max_size=30))
)
def test_any_effect_setting_is_taken_or_refused(text):
    setting = taken_or_refused("", parse_setting, text)
    assert setting is None or setting.name in names()


@given(st.text(max_size=30))
def test_any_scenario_name_is_taken_or_refused(text):
    taken_or_refused("unknown scenario", get_scenario, text)


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(st.dictionaries(st.sampled_from(FIELDS), plain, max_size=4), st.booleans())
def test_any_vehicle_file_is_taken_or_refused(changes, whole):
    text = yaml.safe_dump((GOOD if whole else {}) | changes, allow_unicode=True)
    vehicle = taken_or_refused("mine.yaml: ", parse_vehicle, text, "mine.yaml")
    assert vehicle is None or vehicle.mass > 0


@settings(deadline=None)
@given(st.text(max_size=200))
def test_any_yaml_text_is_taken_or_refused(text):
    taken_or_refused("mine.yaml: ", parse_yaml, text, "mine.yaml")


@given(st.sampled_from(["torque_walk", "position_noise", "kappa", "gyro_noise"]), plain)
def test_any_tuning_is_taken_or_refused(name, value):
    taken_or_refused(name, lambda: UKFTuning(**{name: value}))


@settings(deadline=None)
@given(
    st.lists(st.sampled_from([*TOKENS, "0.1", "1", "400"]), min_size=12, max_size=12),
    st.integers(0, 3),
)
def test_any_row_of_a_log_is_taken_or_refused(tmp_path_factory, fields, row):
    lines = [
        "t,px,py,pz,qw,qx,qy,qz,omega1,omega2,omega3,omega4",
        *(f"0.0{i},0,0,1,1,0,0,0,400,400,400,400" for i in range(4)),
    ]
    lines[1 + row] = ",".join(fields)
    path = tmp_path_factory.mktemp("row") / "log.csv"
    path.write_bytes("\n".join(lines).encode("utf-8", "surrogatepass"))
    log = taken_or_refused("log.csv", read_log, path)
    assert log is None or np.isfinite(log.t).all()


# what a stranger's file could do


@pytest.mark.parametrize(
    "tag",
    [
        "!!python/object/apply:os.system ['touch gone']",
        "!!python/object/new:os.system ['touch gone']",
        "!!python/name:os.system",
        "!!python/module:os",
        "!!python/object:builtins.object {}",
    ],
)
def test_a_yaml_file_makes_no_objects(tmp_path, monkeypatch, tag):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "v.yaml"
    path.write_text(f"name: v\nmass: {tag}\n")
    with pytest.raises(
        InputError, match=r"v\.yaml: not valid YAML: could not determine a constructor"
    ):
        load_vehicle(path)
    (tmp_path / "flight.topics.yaml").write_text(f"pose: {tag}\n")
    (tmp_path / "flight.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(InputError, match=r"topics\.yaml: not valid YAML"):
        read_log(tmp_path / "flight.bag", "rosbag")
    assert not (tmp_path / "gone").exists()


def test_aliases_that_write_out_to_billions_are_refused(tmp_path):
    path = tmp_path / "laughs.yaml"
    path.write_text(LAUGHS)
    with pytest.raises(InputError, match="values, its aliases written out"):
        load_vehicle(path)
    with pytest.raises(InputError, match="within what it stands for"):
        parse_yaml("a: &a [*a]", "round.yaml")
    assert parse_yaml("k: &k [1, 2]\np: *k", "good.yaml") == {"k": [1, 2], "p": [1, 2]}


def test_a_giant_yaml_file_is_refused_before_it_is_parsed(tmp_path):
    path = tmp_path / "giant.yaml"
    with path.open("wb") as file:
        file.truncate(50 * 2**30)  # sparse: no disk is used
    with pytest.raises(InputError, match=rf"giant\.yaml: more than {LARGEST} bytes"):
        read_yaml(path, "a vehicle file")


def test_a_text_that_unpacks_to_more_than_a_flight_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "LARGEST", 1_000_000)
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"0" * 50_000_000))
    with pytest.raises(InputError, match=r"bomb\.csv\.gz: more than 1000000 characters"):
        read_log(path)


def test_a_parquet_file_that_claims_a_billion_rows_is_refused(tmp_path):
    pyarrow = pytest.importorskip(
        "pyarrow", reason="pyarrow is not installed: pip install 'windwrench[parquet]'"
    )
    from pyarrow import parquet

    path = tmp_path / "claim.parquet"
    # constant columns pack to almost nothing, and a small file unpacks to all its rows
    zeros = pyarrow.chunked_array([pyarrow.array(np.zeros(2_500_000))] * 10)
    parquet.write_table(pyarrow.table({"t": zeros}), path)
    assert path.stat().st_size < 1_000_000
    with pytest.raises(InputError, match="claims 25000000 rows"):
        files.open_table(path)


def test_weights_that_are_pickles_are_refused(tmp_path):
    form = FORMS["policy, weights"]
    path = lay_out(form, form.good(), tmp_path / "input")

    class Harm:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "gone",))

    with zipfile.ZipFile(path, "w") as archive:
        header = (
            b"\x93NUMPY\x01\x00v\x00{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(
                127
            )
            + b"\n"
        )
        archive.writestr("weight0.npy", header + pickle.dumps(Harm()))
    assert attempt(form, path)[0] == "refused"
    path.write_bytes(pickle.dumps(Harm()))
    assert attempt(form, path)[0] == "refused"
    with pytest.raises(InputError):
        load_policy(path)
    assert not (tmp_path / "gone").exists()


def test_a_folder_in_a_files_place_is_refused(tmp_path):
    for name, reader in (
        ("a.csv", None),
        ("a.parquet", None),
        ("a.ulg", "px4_ulog"),
        ("a.yaml", None),
    ):
        (tmp_path / name).mkdir()
        with pytest.raises(InputError, match=name):
            load_vehicle(tmp_path / name) if name.endswith("yaml") else read_log(
                tmp_path / name, reader
            )


def test_mutations_reach_everything():
    rng = random.Random(0)
    form = FORMS["CSV"]
    lengths = {len(way(form.good(), rng)) for way in form.ways for _ in range(50)}
    assert len(lengths) > 20
