"""Cut the excerpts of ``tests/data`` out of the whole logs.

``python -m tests.support.make_excerpts`` reads the originals where ``data_paths`` looks for them
and writes every excerpt anew, with the licence's notice beside it. Cells of tables are copied as
they are written, digit by digit; messages of a ULog are copied whole.
"""

import gzip
import shutil
from pathlib import Path

import numpy as np
from pyulog import ULog

from tests.support.data_paths import DATA, EXAMPLE, EXCERPTS, excerpt
from windwrench.identification.logs.readers import nanobench

# flight: seconds of the log's own clock, counted from its first row
NANOBENCH = {"B2_circle_fast_rep3": (8.0, 26.0), "B5_helix_fast_rep2": (8.0, 26.0)}
NANOBENCH_COLUMNS = (
    *("t", "px", "py", "pz", "qx", "qy", "qz", "qw"),
    *(*nanobench.SIGNATURE, "imu_acc_z"),
)
CRAZYSWARM2 = {"log165": (0.0, 60.0), "log202": (0.0, 60.0)}  # all of it
CRAZYSWARM2_LEFT_OUT = ("acc_x_mps2", "acc_y_mps2", "acc_z_mps2")
CRAZYPAD = {
    "normal_flight__E9_log00": (2.0, 12.0),
    "normal_flight__E9_log01": (2.0, 12.0),
    "add_weight_W3_near_M3__E9_log00": (2.0, 12.0),
}
CRAZYPAD_COLUMNS = ("t_s", *(f"motor_m{i}_0to65535" for i in (1, 2, 3, 4)), "vbat_V")
PX4 = {"sample": (5.0, 15.0)}
PX4_TOPICS = ["vehicle_local_position", "vehicle_attitude", "actuator_outputs"]
MOST_BYTES = 150_000  # of one excerpt


def cut_table(
    source: Path,
    target: Path,
    time: str,
    span: tuple[float, float],
    columns: tuple[str, ...] | None = None,
    left_out: tuple[str, ...] = (),
) -> None:
    """Write the rows of a CSV between two times, with those of its columns (all) that are asked
    for.
    """
    whole = source.read_bytes()
    packed = source.suffix == ".gz"
    lines = (gzip.decompress(whole) if packed else whole).decode().splitlines()
    header = lines[0].split(",")
    kept = [header.index(name) for name in columns or header if name not in left_out]
    rows = [line.split(",") for line in lines[1:]]
    clock = np.array([float(row[header.index(time)]) for row in rows])
    inside = (clock - clock[0] >= span[0]) & (clock - clock[0] < span[1])
    text = [",".join(header[i] for i in kept)]
    text += [",".join(row[i] for i in kept) for row, keep in zip(rows, inside, strict=True) if keep]
    target.parent.mkdir(parents=True, exist_ok=True)
    # neither time nor name in the archive: the same bytes every time
    target.write_bytes(gzip.compress(("\n".join(text) + "\n").encode(), 9, mtime=0))


def cut_ulog(source: Path, target: Path, span: tuple[float, float]) -> None:
    """Write those topics of a ULog that its reader reads, between two times after its start."""
    log = ULog(str(source), PX4_TOPICS)
    begin, end = (log.start_timestamp + 1e6 * seconds for seconds in span)
    for topic in log.data_list:
        stamps = topic.data["timestamp"]
        inside = (stamps >= begin) & (stamps < end)
        topic.data = {name: column[inside] for name, column in topic.data.items()}
    target.parent.mkdir(parents=True, exist_ok=True)
    log.write_ulog(str(target))


def main() -> None:
    """Write all excerpts and the notices of their licences."""
    for name, span in NANOBENCH.items():
        target = excerpt(f"nanobench/{name}.csv.gz")
        # the one in the package is smaller by the column that only tests look at
        left_out = ("imu_acc_z",) if target.parent == EXAMPLE else ()
        source = DATA / "nanobench" / f"{name}.csv"
        cut_table(source, target, "t", span, NANOBENCH_COLUMNS, left_out)
    for name, span in CRAZYSWARM2.items():
        target = EXCERPTS / "crazyswarm2" / f"{name}.csv.gz"
        source = DATA / "crazyswarm2_payload" / "csv" / f"{name}.csv"
        cut_table(source, target, "t_s", span, left_out=CRAZYSWARM2_LEFT_OUT)
    for name, span in CRAZYPAD.items():
        target = EXCERPTS / "crazypad" / f"{name}.csv.gz"
        cut_table(DATA / "crazypad" / f"{name}.csv.gz", target, "t_s", span, CRAZYPAD_COLUMNS)
    for name, span in PX4.items():
        cut_ulog(DATA / "px4" / f"{name}.ulg", EXCERPTS / "px4" / f"{name}.ulg", span)
    for notice, folder in (
        ("nanobench/LICENSE.upstream.txt", "nanobench"),
        ("crazyswarm2_payload/LICENSE.upstream.txt", "crazyswarm2"),
        ("crazypad/LICENSE.upstream.txt", "crazypad"),
        ("px4/LICENSE.upstream.md", "px4"),
    ):
        shutil.copyfile(DATA / notice, EXCERPTS / folder / "LICENSE")
    shutil.copyfile(EXCERPTS / "nanobench" / "LICENSE", EXAMPLE / "LICENSE")
    for path in sorted(EXCERPTS.glob("*/*")):
        assert path.stat().st_size <= MOST_BYTES, path
        print(f"{path.relative_to(EXCERPTS)}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
