"""Files that bite: small ones that unpack to gigabytes, pipes and devices that never end, and
names that are no text. Memory and time are measured in a process of their own.
"""

import gzip
import hashlib
import io
import json
import os
import pickle
import struct
import sys
import zipfile
import zlib
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.fuzz.spoiling import LAUGHS
from tests.support.outcomes import refused
from tests.support.paths import ROOT
from tests.support.programs import said
from windwrench.controllers.trained_policy import FORMAT, load_policy
from windwrench.dynamics import load_vehicle
from windwrench.identification import read_log
from windwrench.identification.logs import tables, text_table
from windwrench.identification.logs.flight_log import POSE, ROTORS
from windwrench.runtime import regular_files
from windwrench.runtime.file_limits import LIMITS
from windwrench.runtime.regular_files import read_json
from windwrench.runtime.yaml_file import parse_yaml

REQUIRED = ("t", *POSE, *ROTORS)
HEADER = (",".join(REQUIRED) + "\n").encode()
# an eighth of what users may have
SIZES = ("table_text", "table_rows", "table_numbers", "list_numbers", "arrays", "binary_log")
SMALL = {name: getattr(LIMITS, name) // 8 for name in (*SIZES, "policy_weights")}
MEMORY = 3e8  # of which the program itself takes 1.6e8
TEXT_MEMORY = 2e8  # the memory of tables, which grows by less than such a text
SECONDS = 3.0
PARQUET = find_spec("pyarrow") is not None
ULOG = find_spec("pyulog") is not None

# each file is read in one process, so that the peak of its memory is that of the worst
CHILD = """
import json, os, resource, sys
from pathlib import Path
from windwrench.controllers.trained_policy import load_policy
from windwrench.dynamics import load_vehicle
from windwrench.identification import read_log
from windwrench.runtime.errors import InputError
from windwrench.runtime.file_limits import LIMITS

for name, value in json.loads(sys.argv.pop(1)).items():
    object.__setattr__(LIMITS, name, value)

# of this program alone: resource's maximum starts from that of whoever started it
def peak_memory():
    status = Path("/proc/self/status").read_text()
    ours = 1024 * int(status.split("VmHWM:")[1].split()[0])
    # that of a process that reads MATLAB's files begins with ours
    return max(ours, 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)

for path in Path(sys.argv[1]).parent.glob("few.*"):  # what is compiled once is no file's cost
    try:
        read_log(path, None, load_vehicle("ardrone2"))
    except InputError:
        pass
for path in sys.argv[1:]:
    began = sum(os.times()[:4])
    try:
        if path.endswith((".ulg", ".BIN", ".bbl", "log00")):
            read_log(path, None, load_vehicle("ardrone2"))
        elif path.endswith(".npz") and Path(path).with_suffix(".json").exists():
            load_policy(path)
        elif path.endswith(".yaml"):
            load_vehicle(path)
        else:
            read_log(path)
        said = "read"
    except InputError as error:
        said = str(error)
    print(json.dumps([path, said, sum(os.times()[:4]) - began, peak_memory()]), flush=True)
"""


def packed_often(piece, times):
    """Return the gzip file of a piece repeated: its packed parts follow one another."""
    return gzip.compress(HEADER) + gzip.compress(piece, 1) * times


def matlab(count, size, kind=6, stored=9, item=8):
    """Return a MATLAB file of ``count`` packed arrays of zeros of ``size`` bytes each, of a class
    and a type of its numbers.
    """
    body = struct.pack("<IIII", 6, 8, kind, 0) + struct.pack("<IIii", 5, 8, size // item, 1)
    body += struct.pack("<II8s", 1, 1, b"t") + struct.pack("<II", stored, size)
    start = struct.pack("<II", 14, len(body) + size) + body
    packing = zlib.compressobj(1)
    piece = 2**20  # which is packed once, and repeated
    packed = packing.compress(start) + packing.flush(zlib.Z_FULL_FLUSH)
    packed += (packing.compress(bytes(piece)) + packing.flush(zlib.Z_FULL_FLUSH)) * (size // piece)
    high, low = divmod(zlib.adler32(start), 2**16)
    packed += b"\x03\x00" + struct.pack(">HH", (high + size * low) % 65521, low)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return head + (struct.pack("<II", 15, len(packed)) + packed) * count


class Harm:
    """What runs a program when it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("harm",)


def weights(kind, shape, *pieces):
    """Return the archive of one array (an .npz) that holds some pieces of bytes."""
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    out = io.BytesIO()
    with (
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("weight0.npy", "w", force_zip64=True) as member,
    ):
        member.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + header.encode())
        for piece in pieces:
            member.write(piece)
    return out.getvalue()


def parquet_bombs(folder):
    """Write a column of 10,000 times one text of 1 MB, which takes its place once, 3 million rows
    of zeros, 40 columns of 500,000 numbers in lists, and 40 of lists of which one holds any.
    """
    import pyarrow
    from pyarrow import parquet

    rows = 10_000
    zeros = pyarrow.chunked_array([np.zeros(300_000)] * 10)
    parquet.write_table(pyarrow.table({"t": zeros}), folder / "claim.parquet")
    text = pyarrow.DictionaryArray.from_arrays(
        pyarrow.array(np.zeros(rows, np.int32)), pyarrow.array(["1" * 1_000_000])
    )
    columns = {name: pyarrow.array(np.arange(rows) * 1.0) for name in REQUIRED} | {"px": text}
    parquet.write_table(pyarrow.table(columns), folder / "texts.parquet")
    many = pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(np.zeros(500_000)), 4)
    lists = pyarrow.table({f"a{i}": many for i in range(40)})
    parquet.write_table(lists, folder / "lists.parquet")
    short = pyarrow.ListArray.from_arrays([0] * 50_000 + [80], pyarrow.array(np.zeros(80)))
    lists = pyarrow.table({f"a{i}": short for i in range(40)})
    parquet.write_table(lists, folder / "sparse.parquet")


def ulog(*messages):
    """Return a ULog of messages (kind, bytes)."""
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    return head + b"".join(
        struct.pack("<HB", len(data), ord(kind)) + data for kind, data in messages
    )


NESTED_ULOG = ulog(
    ("F", b"c:float[60000] x;"),
    ("F", b"b:c[60000] y;"),
    ("F", b"vehicle_attitude:uint64_t timestamp;b[60000] z;"),
    *[("A", struct.pack("<BH", 0, i) + b"vehicle_attitude") for i in range(100)],
)
# a type of message without a column, 20 million times
EMPTY_DATAFLASH = struct.pack("<3sBB4s16s64s", b"\xa3\x95\x80", 9, 3, b"RCOU", b"", b"")
# a log whose events hold 400 variables of a byte each
NARROW_SD_CARD = struct.pack("<BHHH", 0xBC, 2, 1, 7) + b"e\0" + struct.pack("<H", 400)
NARROW_SD_CARD += b"".join(b"v%d(B)\0" % i for i in range(400))
NARROW_ROW = b"\x07\0" + bytes(408)
# a log whose frames are a letter each
EMPTY_FRAMES = b"".join(
    [
        b"H Product:Blackbox\nH Data version:2\n",
        b"H Field I name:loopIteration,time\nH Field I predictor:0,0\nH Field I encoding:9,9\n",
        b"H Field P predictor:6,0\nH Field P encoding:9,9\n",
    ]
)
TEXTS_ULOG = ulog(*[("P", b"\x09float " + b"%3x" % i + b"\0\0\0\0") for i in range(4096)])
TEXTS_ULOG += 59 * TEXTS_ULOG[len(ulog()) :]


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="memory is read as Linux tells it"
)
def test_files_that_unpack_to_gigabytes_cost_little(tmp_path):
    blank = b"1,2\n" * 2 + (b" " * 999_999 + b"\n") * 16
    columns = ",".join(f"{i:x}" for i in range(150_000)) + "\n1\n"
    dataflash = EMPTY_DATAFLASH + (b"\xa3\x95\x09" * 2**20) * 8 + bytes(7)
    files = {
        "zeros.csv.gz": (packed_often(b"0" * 2**23, 20), "more than 1000000 in line 2"),
        "lines.csv.gz": (packed_often(b"1,2\n" * 2**21, 20), "more than 500000 rows"),
        "blank.csv.gz": (packed_often(blank, 20), "more than 134217728 characters"),
        "parts.csv.gz": (gzip.compress(b"") * 200_000, "packed bytes unpack to 0"),
        "columns.csv": (columns.encode(), "no table of numbers in its first 1 line"),
        "deep.yaml": (b"[" * 100_000, "more than 60 deep"),
        "empty.BIN": (dataflash, "no motors that turn; expected ESC"),
        "narrow_log00": (NARROW_SD_CARD + NARROW_ROW * 22_500, "more than 8388608 numbers"),
        "empty.bbl": (EMPTY_FRAMES + b"IP" * 2**19, "more than 500000 frames"),
        "damaged.bbl": (EMPTY_FRAMES + b"I\xff" * 2**19, "frame(s) that can be decoded"),
        "sparse.csv": (b"", "zero bytes"),
        "sparse.BIN": (EMPTY_DATAFLASH, "more than 33554432 bytes"),
        "giant.yaml": (b"", "more than 200000 bytes"),
        "laughs.yaml": (LAUGHS.encode(), "values, its aliases written out"),
        "round.yaml": (b"a: &a [*a]", "within what it stands for"),
        "policy.npz": (weights("<f4", (2**23,), *[bytes(2**23)] * 4), "unpacks to 335545"),
        "harm.npz": (weights("|O", (1,), pickle.dumps(Harm())), "Object arrays cannot be loaded"),
        "zeros.mat": (matlab(1, 4 * 2**30 - 2**26), "unpacks to more than 67108864 bytes"),
        "many.mat": (matlab(9, 2**23), "unpacks to more than 67108864 bytes"),
        "text.mat": (matlab(1, 7 * 2**23, 4, 4, 2), "it takes more than 117440512 bytes of"),
        "bytes.mat": (matlab(1, 2**22, 9, 2, 1), "more than 500000 rows"),
        "log.npz": (weights("<f8", (2**23,), *[bytes(2**23)] * 8), "unpacks to 6710899"),
        "pickle.npz": (pickle.dumps(Harm()), "no zip archive"),
    }
    if ULOG:
        files["nested.ulg"] = NESTED_ULOG, "more than 200000 fields"
        files["texts.ulg"] = TEXTS_ULOG, "more than 200000 parameters"
        # each byte of the filling seems to begin a message of 64 kB
        files["filled.ulg"] = ulog() + 300_000 * b"\xff", "places hold no message"
    for name, (content, _) in files.items():
        (tmp_path / name).write_bytes(content)
        if name.endswith(".npz") and name != "log.npz":  # the card vouches for it
            card = {"format": FORMAT, "sha256": hashlib.sha256(content).hexdigest()}
            (tmp_path / name).with_suffix(".json").write_text(json.dumps(card))
    for name, size in (("sparse.csv", 2**34), ("sparse.BIN", 2**34), ("giant.yaml", 50 * 2**30)):
        os.truncate(tmp_path / name, size)
    expected = {name: words for name, (_, words) in files.items()}
    if PARQUET:
        parquet_bombs(tmp_path)
        expected["texts.parquet"] = "column px cannot be read: it holds"
        lists = "more than 4194304 numbers of lists; expected one flight"
        expected["lists.parquet"] = lists
        expected["sparse.parquet"] = lists
        expected["claim.parquet"] = "more than 500000 rows; expected one flight"
    (tmp_path / "few.bbl").write_bytes(EMPTY_FRAMES + b"IP" * 8)
    paths = (str(tmp_path / name) for name in expected)
    told = said(sys.executable, "-c", CHILD, json.dumps(SMALL), *paths, timeout=120, cwd=tmp_path)
    assert not (tmp_path / "harm").exists()
    found = [json.loads(line) for line in told.splitlines()]
    assert len(found) == len(expected)
    for path, line, seconds, memory in found:
        assert line.startswith(str(tmp_path)), line
        assert expected[Path(path).name] in line
        assert "\n" not in line
        assert seconds < SECONDS, path
        assert memory < (TEXT_MEMORY if path.endswith(".csv.gz") else MEMORY), path


@pytest.mark.parametrize("name", ["x.csv", "x.csv.gz", "x.parquet", "x.ulg", "x.bag", "x.mcap"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_is_no_regular_file_is_refused_at_once(kind, name, tmp_path):
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    for module in {"parquet": ["pyarrow"], "ulg": ["pyulog"], "bag": ["rosbags"]}.get(name[2:], []):
        pytest.importorskip(module)
    readers = {"x.ulg": "px4_ulog", "x.bag": "rosbag", "x.mcap": "rosbag"}
    what = {
        "pipe": "is a pipe",
        "device": "is a device",
        "folder": "(is a folder|cannot be read|no metadata)",
    }
    with refused(rf"{name}: {what[kind]}"):
        read_log(path, readers.get(name), load_vehicle("ardrone2"))


def test_other_files_are_regular_too(tmp_path):
    assert parse_yaml("k: &k [1, 2]\np: *k", "good.yaml") == {"k": [1, 2], "p": [1, 2]}
    for name in ("p.npz", "p.json", "v.yaml"):
        os.mkfifo(tmp_path / name)
    with refused(r"p\.json: is a pipe"):
        load_policy(tmp_path / "p.npz")
    with refused(r"v\.yaml: is a pipe"):
        load_vehicle(tmp_path / "v.yaml")
    (tmp_path / "large.json").write_bytes(b" " * (LIMITS.json_text + 1))
    with refused(r"large\.json: more than 4194304 bytes"):
        read_json(tmp_path / "large.json", "a card")


def test_a_column_that_would_unpack_to_too_much_is_refused_by_the_footer(tmp_path, monkeypatch):
    pyarrow = pytest.importorskip("pyarrow", reason="pip install 'windwrench[parquet]'")
    from pyarrow import parquet

    rows = 1_200
    columns = {name: np.full(rows, float(name == "qw")) for name in REQUIRED}
    columns["t"] = 0.005 * np.arange(rows)
    path = tmp_path / "flight.parquet"
    for packing in ("snappy", "zstd", "none"):
        for dictionary in (True, False):
            parquet.write_table(
                pyarrow.table(columns), path, compression=packing, use_dictionary=dictionary
            )
            assert_array_equal(read_log(path).t, columns["t"])
    monkeypatch.setattr(tables, "LIMITS", replace(LIMITS, table_numbers=1_000))
    with refused("more than 1000 numbers in column"):
        read_log(path)


def test_blocks_of_a_text_join_without_a_seam(tmp_path, monkeypatch):
    rng = default_rng(0)
    rows = 1000
    table = rng.standard_normal((rows, len(REQUIRED)))
    table[:, 0], table[:, 4:8], table[:, 8:] = 0.01 * np.arange(rows), (1, 0, 0, 0), 300.0
    lines = [",".join(map(repr, row)) for row in table.tolist()]
    want = read_text(tmp_path, lines)
    monkeypatch.setattr(text_table, "_BLOCK", 7)
    monkeypatch.setattr(text_table, "_BUFFER", 1000)
    mixed = lines.copy()
    mixed[9::50] = ['"' + line.replace(",", '",', 1) for line in lines[9::50]]
    for log in (
        want,
        read_text(tmp_path, lines),
        read_text(tmp_path, mixed),
        read_text(tmp_path, [f'"{line.replace(",", chr(34) + "," + chr(34))}"' for line in lines]),
        read_text(tmp_path, lines, "\r\n"),
    ):
        assert_array_equal(log.position, table[:, 1:4])
        assert_array_equal(log.t, table[:, 0])
    lines[777] = lines[777].replace(",", ",here", 1)
    with refused(r"column px, row 778 \(line 779\): 'here"):
        read_text(tmp_path, lines)
    monkeypatch.setattr(text_table, "LIMITS", replace(LIMITS, table_rows=99))
    with refused("more than 99 rows; expected one flight"):
        read_text(tmp_path, lines)


def test_a_pipe_that_takes_the_place_of_a_file_is_refused_and_not_waited_for(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "log")
    monkeypatch.setattr(regular_files, "check_regular", lambda *_: None)  # it was a file then
    with refused("log: is a pipe; expected a log, a regular file"):
        regular_files.open_regular(tmp_path / "log", "a log")


def read_text(folder, lines, end="\n"):
    path = folder / "flight.csv.gz"
    path.write_bytes(gzip.compress((HEADER.decode() + end.join([*lines, "", " ", ""])).encode()))
    return read_log(path)


def test_the_page_states_the_limits():
    page = (ROOT / "docs" / "readers.md").read_text(encoding="utf-8")
    table = page.partition("| what | at most |")[2]
    stated = [line.rpartition(" | ")[2].strip("| ") for line in table.splitlines() if "|" in line]
    mib = 2**20
    assert stated[1:] == [
        f"{LIMITS.table_text // 2**30} GiB",
        f"{LIMITS.table_rows // 10**6} million",
        f"{round(LIMITS.table_numbers / 1e6)} million",
        f"{round(LIMITS.list_numbers / 1e6)} million",
        f"{LIMITS.arrays // mib} MiB",
        f"{LIMITS.binary_log // mib} MiB",
        f"{LIMITS.ulog_file // mib} MiB",
        f"{LIMITS.bag_chunk // mib} MiB; {LIMITS.bag_unpacked // 2**30} GiB",
    ]
    assert f"{LIMITS.yaml_text // 1000} kB and {LIMITS.yaml_values:,} values" in page
