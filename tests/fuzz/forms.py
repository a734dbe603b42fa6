"""Every form of input that a stranger may give: a good example of each, how it is spoiled, and what
is done with it.
"""

import gzip
import hashlib
import io
import json
import math
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import pyarrow
from hypothesis import strategies as st
from pyarrow import parquet

from tests.fuzz.spoiling import places, spoiled_bytes, spoiled_table, spoiled_text
from tests.support.blackbox_writer import blackbox
from tests.support.blackbox_writer import flight as blackbox_rows
from tests.support.converted_flights import write_bag
from tests.support.dataflash_writer import (
    dataflash,
    dataflash_text,
    imu,
    micro,
    parm,
    rcou,
    xkf1,
    xkq,
)
from tests.support.map_tables import hover_columns, table_text, vehicle_of
from tests.support.paths import ROOT
from tests.support.sd_card_writer import sd_card, sd_card_before_2021
from tests.support.ulog_writer import battery, control, esc, odometry, sensor_combined, ulog_bytes
from tests.support.vehicles import POSE
from windwrench.controllers.features import Features
from windwrench.controllers.trained_policy import load_policy, save_policy
from windwrench.dynamics.effects import parse_setting
from windwrench.dynamics.vehicle_file import dump_vehicle, load_vehicle, parse_vehicle
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.identification.logs.flight_log import FlightLog, write_log
from windwrench.identification.logs.map_guess import guess_map
from windwrench.identification.logs.mapped_log import map_table
from windwrench.identification.logs.reading import TABLES, finished, read_log
from windwrench.identification.logs.text_table import open_table
from windwrench.identification.wrench_series import estimate_log

Way = Callable[[bytes], st.SearchStrategy[bytes]]

_COUNT = 60  # samples of a good log
_PERIOD = 0.01  # s
_LONGEST = 400  # samples of a log that is estimated after it was read


@dataclass(frozen=True)
class Form:
    """A form of input."""

    name: str
    file: str  # name of the spoiled file
    good: Callable[[], bytes]
    ways: tuple[Way, ...]
    use: Callable[[Path], object]  # reads the file and works with what it says
    command: tuple[str, ...] = ()  # of windwrench, which takes the file's path last
    beside: Callable[[], Mapping[str, bytes]] = dict  # files that must lie beside it

    @property
    def spoiled(self):
        """A strategy for inputs that are the good one, spoiled in one of the ways or by bytes after
        it.
        """
        once = st.one_of([way(self.good()) for way in self.ways])
        return once | once.flatmap(spoiled_bytes)


def _times():
    return _PERIOD * np.arange(_COUNT, dtype=np.float64)


_vehicle = cache(load_vehicle)


def _written(write, name):
    """Return the bytes of every file by its name, of a writer that is given a path ending so."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return {p.name: p.read_bytes() for p in Path(folder).rglob("*") if p.is_file()}


@cache
def _own_log(name):
    """Return a hover with a slow turn, in the kit's own form."""
    t = _times()
    vehicle = _vehicle("ardrone2")
    position = np.column_stack([0.1 * np.sin(t), 0.1 * np.cos(t), 1.0 + 0.0 * t])
    quaternion = np.column_stack([np.cos(0.1 * t), 0.0 * t, 0.0 * t, np.sin(0.1 * t)])
    log = FlightLog(
        t,
        position,
        quaternion,
        np.full((_COUNT, 4), vehicle.hover_rate),
        np.full(_COUNT, 11.1),
        np.zeros((_COUNT, 3)),
        np.zeros((_COUNT, 3)),
    )
    return _written(partial(write_log, log), name)[name]


def _table(log_map):
    """Return a table that a reader knows by the columns of its map."""
    return table_text(hover_columns(log_map, _COUNT, _PERIOD))


def _betaflight_table():
    """Return a table as blackbox_decode writes it."""
    columns = {
        "loopIteration": np.arange(_COUNT, dtype=np.float64),
        "time (us)": 1e6 * _times(),
        **{f"{name}[{i}]": 0.0 for name in ("gyroADC", "accSmooth") for i in range(3)},
        "accSmooth[2]": 2048.0,
        "vbatLatest (V)": 11.1,
        **{f"motor[{i}]": 1500.0 for i in range(4)},
        **{f"eRPM[{i}]": 420.0 for i in range(4)},
    }
    return table_text(columns)


@cache
def _bag(kind):
    """Return the files of a bag with a pose and rotor speeds: one of ROS 1, or a folder's of ROS 2,
    by the ending of the file that holds the messages."""
    still = FlightLog(
        _times(),
        np.tile([0.0, 0.0, 1.0], (_COUNT, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (_COUNT, 1)),
        np.full((_COUNT, 4), 376.0),
    )
    name = "flight.bag" if kind == "bag" else "flight"
    return _written(lambda path: write_bag(still, path, kind, "/pose"), name)


TOPIC_MAP = (
    b"position: {topic: /pose}\nrotors:\n  topic: /motors\n  unit: rad/s\n  order: [3, 2, 4, 1]\n"
)


def _log(path, reader=None, vehicle="ardrone2"):
    """Read a log, and estimate the wrench on it where it is short."""
    log = read_log(path, reader, _vehicle(vehicle))
    if len(log.t) <= _LONGEST and log.has_pose and log.has_rotor_speeds:
        assert np.isfinite(estimate_log(log, _vehicle(vehicle)).force).all()


_MAP = (
    b"about: a table\nworld: ned\nbody: frd\n"
    b"time: {column: t, unit: s, offset: 0}\n"
    b"position: {columns: [px, py, pz], unit: m, signs: [1, -1, 1]}\n"
    b"attitude: {columns: [qw, qx, qy, qz], order: wxyz, sense: body_to_world}\n"
    b"rotors: {columns: [omega1, omega2, omega3, omega4], unit: rad/s, order: [1, 2, 3, 4]}\n"
    b"battery: {column: vbat, unit: V, cells: 1, optional: true}\n"
)


def _use_map(path):
    """Read a good table by a map."""
    read_log(path.parent / "log.csv", vehicle=_vehicle("ardrone2"), map=path)


def _foreign_table():
    head, _, rest = _own_log("log.csv").decode().partition("\n")
    head = head.replace("omega", "rpm").replace("px", "x").replace("py", "y").replace("pz", "z")
    return f"{head}\n{rest}".encode()


def _use_foreign(path):
    """Guess a map for a table, and read it by that."""
    table = open_table(path)
    guess = guess_map(table, _vehicle("ardrone2"))
    with np.errstate(over="ignore", invalid="ignore"):
        finished(map_table(table, guess.log_map), _vehicle("ardrone2"))


def _folder_bag(path):
    _log(path.parent, "rosbag:" + str(path.parent / "map.yaml"))


def _use_vehicle(path):
    """Load a vehicle, write it and read it back, and let a filter know it."""
    vehicle = load_vehicle(path)
    assert dump_vehicle(parse_vehicle(dump_vehicle(vehicle))) == dump_vehicle(vehicle)
    ukf = WrenchUKF(vehicle, UKFTuning.for_vehicle(vehicle))
    ukf.reset(*POSE)
    ukf.step(np.full(4, min(vehicle.hover_rate, vehicle.omega_max)), *POSE)


@cache
def _policy():
    """Return the files of a policy with one hidden layer."""
    features = Features(("torque_z", "force_x"), 2)
    weights = {
        "weight0": np.ones((3, features.size), np.float32),
        "bias0": np.zeros(3, np.float32),
        "weight1": np.ones((1, 3), np.float32),
        "bias1": np.zeros(1, np.float32),
    }
    card = {
        "features": {
            "frame": list(features.frame),
            "history": features.history,
            "scale": list(features.scale),
        },
        "repeat": 1,
        "activation": "relu",
        "squash": True,
    }
    return _written(partial(save_policy, card, weights), "policy.npz")


def _use_policy(path):
    """Load a policy and fly a decision; the card is made to vouch for spoiled weights, as an
    attacker's would.
    """
    if path.suffix == ".npz":
        card = json.loads(path.with_suffix(".json").read_bytes())
        card["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
        path.with_suffix(".json").write_text(json.dumps(card), encoding="utf-8")
    assert load_policy(path)(np.zeros(8), {}).shape == (1,)


def _vehicle_with_effects():
    text = (ROOT / "dynamics" / "vehicles" / "ardrone2.yaml").read_text() + "effects:\n"
    for name in ("rotor_drag", "mass", "slung_payload", "battery_sag", "latency"):
        setting = parse_setting(name, _vehicle("ardrone2"))
        given = ", ".join(f"{k}: {v:g}" for k, v in setting.coefficients.items())
        text += f"- name: {name}\n  coefficients: {{{given}}}\n"
    return text.encode()


@cache
def _ulog():
    t = _times()
    topics = {
        "vehicle_mocap_odometry": odometry(t),
        "esc_status": esc(t),
        "sensor_combined": sensor_combined(t),
        "actuator_motors": control(t, np.full((_COUNT, 4), 0.5)),
        "battery_status": battery(t, np.full(_COUNT, 11.1)),
    }
    return ulog_bytes(topics, {"THR_MDL_FAC": 0.3, "CA_ROTOR_COUNT": 4})


def _messages():
    t = 10.0 + _times()
    volts = {"TimeUS": micro(t), "Inst": 0.0 * t, "Volt": 0.0 * t + 11.1}
    return [parm(), xkf1(t), xkq(t), imu(t), rcou(t), ("BAT", "QBf", volts)]


def _dataflash_text():
    return dataflash_text(_messages()).encode()


def _events():
    """Return times (s) and variables of a Crazyflie's SD-card log."""
    columns = hover_columns("cflib", _COUNT, _PERIOD)
    del columns["timestamp"]  # each event has its own
    return 30.0 + _times(), {
        f"{name}({'H' if name.startswith('motor.') else 'f'})": np.broadcast_to(values, _COUNT)
        for name, values in columns.items()
        if not name.startswith("rpm.")
    }


def _zipped(spoiled):
    """Return a way to spoil what a gzip file holds."""
    return lambda data: spoiled(gzip.decompress(data)).map(lambda text: gzip.compress(text, 1))


KINDS = ("a", None, True, [1.0], b"\xff", math.nan, math.inf, 1e308, 2**62)


@st.composite
def _spoiled_parquet(draw, data):
    """Take a column of a Parquet file away, give it twice, cut it or change its type."""
    table = parquet.read_table(io.BytesIO(data))
    i = draw(places(table.column_names))
    name = table.column_names[i]
    count = table.num_rows
    how = draw(st.sampled_from(("away", "twice", "cut", "type")))
    if how == "away":
        table = table.remove_column(i)
    elif how == "twice":
        table = table.append_column(name, table.column(i))
    elif how == "cut":
        table = table.slice(0, draw(st.sampled_from((0, 1, 2, count - 1))))
    else:
        value = draw(st.sampled_from((*KINDS, {"a": 1})))
        table = table.set_column(i, name, pyarrow.array([value] * count))
    out = io.BytesIO()
    parquet.write_table(table, out, row_group_size=draw(st.sampled_from((7, 1000))))
    return out.getvalue()


_BYTES = (spoiled_bytes,)
_CELLS = (spoiled_table, spoiled_bytes)
_WORDS = (spoiled_text, spoiled_bytes)
_PARQUET = (_spoiled_parquet, spoiled_bytes)
_BAGS = {"rosbag 1": "bag", "rosbag 2, SQLite": "db3", "rosbag 2, MCAP": "mcap"}


def _form_of_log(name, file, good, ways, reader=None, vehicle="ardrone2", beside=dict):
    """Return the form of a log that is read, and estimated, by a reader or the file's content."""
    named = () if reader is None else ("--reader", reader)
    command = ("estimate", "--out", "out", "--vehicle", vehicle, *named)
    return Form(
        name, file, good, ways, partial(_log, reader=reader, vehicle=vehicle), command, beside
    )


def forms():
    """Return every form of input by its name."""
    log = _form_of_log
    flown = ("record", "--seconds", "1", "--out", "out", "--vehicle")
    sd = "crazyflie_sd", "crazyflie"
    own = partial(_own_log, "log.csv")
    packed = (_zipped(spoiled_table), spoiled_bytes)
    scored = ("benchmark", "--episodes", "1", "--out", "out", "--controllers")
    found = [
        log("CSV", "log.csv", own, _CELLS),
        log("gzipped CSV", "log.csv.gz", partial(_own_log, "log.csv.gz"), packed),
        *(
            log(name, "log.csv", partial(_table, log_map), _CELLS, name, vehicle_of(log_map))
            for name, log_map in TABLES.items()
        ),
        log("betaflight_csv", "log.csv", _betaflight_table, _CELLS),
        log("ardupilot_bin", "log.BIN", lambda: dataflash(_messages()), _BYTES, "ardupilot_bin"),
        log("ardupilot_bin, text", "flight.log", _dataflash_text, _WORDS, "ardupilot_bin"),
        log("betaflight", "log.bbl", lambda: blackbox(blackbox_rows(_COUNT)), _BYTES, "betaflight"),
        log("crazyflie_sd", "log00", lambda: sd_card({"fixedFrequency": _events()}), _BYTES, *sd),
        log("crazyflie_sd, old", "log01", lambda: sd_card_before_2021(*_events()), _BYTES, *sd),
        Form("vehicle with effects", "v.yaml", _vehicle_with_effects, _WORDS, _use_vehicle, flown),
        Form(
            "log map",
            "map.yaml",
            lambda: _MAP,
            _WORDS,
            _use_map,
            ("check", "log.csv", "--out", "out", "--map"),
            lambda: {"log.csv": own()},
        ),
        Form(
            "table of other columns",
            "log.csv",
            _foreign_table,
            _CELLS,
            _use_foreign,
            ("check", "--out", "out", "--vehicle", "ardrone2"),
        ),
        Form(
            "policy, weights",
            "policy.npz",
            lambda: _policy()["policy.npz"],
            _BYTES,
            _use_policy,
            scored,
            lambda: {"policy.json": _policy()["policy.json"]},
        ),
        Form(
            "policy, card",
            "policy.json",
            lambda: _policy()["policy.json"],
            _WORDS,
            _use_policy,
            scored,
            lambda: {"policy.npz": _policy()["policy.npz"]},
        ),
        log("Parquet", "log.parquet", partial(_own_log, "log.parquet"), _PARQUET),
        log("px4_ulog", "log.ulg", _ulog, _BYTES, "px4_ulog"),
        *(
            log(
                name,
                f"flight.{kind}",
                lambda kind=kind: _bag(kind)[f"flight.{kind}"],
                _BYTES,
                "rosbag",
                beside=lambda: {"flight.topics.yaml": TOPIC_MAP},
            )
            for name, kind in _BAGS.items()
        ),
        Form(
            "rosbag 2, metadata",
            "metadata.yaml",
            lambda: _bag("db3")["metadata.yaml"],
            _WORDS,
            _folder_bag,
            beside=lambda: {"flight.db3": _bag("db3")["flight.db3"], "map.yaml": TOPIC_MAP},
        ),
        Form(
            "topic map",
            "flight.topics.yaml",
            lambda: TOPIC_MAP,
            _WORDS,
            lambda path: _log(path.with_name("flight.bag"), "rosbag"),
            beside=lambda: {"flight.bag": _bag("bag")["flight.bag"]},
        ),
    ]
    return {form.name: form for form in found}


def lay_out(form, data, folder):
    """Write a spoiled input and what belongs beside it into an empty folder; return its path."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in form.beside().items():
        (folder / name).write_bytes(content)
    path = folder / form.file
    path.write_bytes(data)
    return path
