"""First sentences of commands on hard and shared logs: ``python -m tests.support.golden_sentences``
writes ``tests/golden/sentences.json`` anew. Read each with the right answer beside it
(``hard_logs/README.md``): would an engineer sign the sentence?
"""

import json
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

from tests.support.data_paths import DATA, data_file
from tests.support.flown import recorded
from tests.support.paths import ROOT
from windwrench.commands.changes import compare
from windwrench.commands.checking import check
from windwrench.commands.diagnosing import diagnose
from windwrench.commands.estimating import estimate
from windwrench.commands.flight_logs import LogOptions
from windwrench.commands.identifying import identify
from windwrench.commands.terminal import silently
from windwrench.identification.logs.flight_log import write_log
from windwrench.runtime.errors import InputError

GOLDEN = ROOT / "tests" / "golden" / "sentences.json"
VEHICLES = {  # by folder; of other folders the log's own, if the log names one
    "hard_logs": "ardrone2",
    "made": "ardrone2",
    "odd_logs": "ardrone2",
    "flights": str(DATA / "flights" / "vehicle.yaml"),
}
MASSES = {"hard_logs": 0.465, "motor_faults": 1.5}
HARD = {
    "check": "actuator_only ardupilot_rpm_tenth.bin asctec_plus.csv.gz bf_erpm100_names.bbl "
    "excel_time.csv.gz motive_take.csv.gz ned_quaternion_swapped.csv.gz "
    "px4_mocap_enu_unturned.ulg px4_one_esc_low.ulg same_motor_four_times.csv.gz "
    "vicon_nexus.csv.gz",
    "diagnose": "healthy_pose_50hz_rows_200hz.csv.gz healthy_pose_67hz_rows_200hz.csv.gz "
    "matlab_struct.mat perfect_model_gusts_10mN.csv.gz perfect_model_gusts_10mN_imu.csv.gz "
    "perfect_model_gusts_30mN.csv.gz perfect_model_smooth_rounded.csv.gz pose_late_40.csv.gz "
    "pose_late_80.csv.gz px4_healthy_mocap48_imu250.ulg px4_one_esc_low.ulg rubber_tether.csv.gz "
    "time_two_decimals.csv.gz",
    "estimate": "imu_clock_late.csv.gz",
    "identify": "px4_gz_rads_as_rpm.ulg same_motor_four_times.csv.gz",
}
SHARED = {
    "check": "ardupilot/backend_log_80k.BIN crazyflie_imu/log10 odd_logs/px4_esc_4hz.ulg "
    "idsia/random1_20251017_run1.parquet px4/sample.ulg px4/sample_log_small.ulg "
    "odd_logs/betaflight_time_rollover.bbl racer/flight_c.csv.gz "
    "motor_faults/TestCase_3_2000000002.ulg",
    "diagnose": "crazyswarm2_payload/csv/log165.csv crazyswarm2_payload/csv/log201.csv "
    "flights/labelled_00.csv.gz flights/labelled_05.csv.gz flights/labelled_06.csv.gz "
    "flights/labelled_07.csv.gz nanobench/B5_helix_fast_rep2.csv "
    "odd_logs/px4_healthy_esc_200hz.ulg made/wind.csv",
    "estimate": "flights/labelled_04.csv.gz",
    "identify": "motor_faults/TestCase_3_1000000002.ulg",
    "compare": "crazypad/cut_propeller_M3_3mm__E9_log00.csv.gz",
}
CASES = [
    *(f"{command} hard_logs/{x}" for command, logs in HARD.items() for x in logs.split()),
    *(f"{command} {x}" for command, logs in SHARED.items() for x in logs.split()),
]
QUICK = {  # one of each command, of little processor time; ``compare`` is in ``test_demo.py``
    "check hard_logs/motive_take.csv.gz",
    "check hard_logs/px4_one_esc_low.ulg",
    "diagnose crazyswarm2_payload/csv/log165.csv",
    "identify hard_logs/same_motor_four_times.csv.gz",
    "identify motor_faults/TestCase_3_1000000002.ulg",
}


def _windy(path):
    """Write 30 s of an AR.Drone in a wind of 4 m/s from +x, of which its file states nothing."""
    write_log(recorded("excite", 30.0, wind={"wx": -4.0, "wy": 0.5, "wz": 0.0, "cd": 0.03}), path)
    return path


def first_sentence(case):
    """Return the first sentence of a command on a log, or its refusal, without the folder."""
    command, _, name = case.partition(" ")
    folder = name.split("/")[0]
    reading = LogOptions(vehicle=VEHICLES.get(folder))
    undrawn = patch("windwrench.identification.report.log_channels.write_png")
    with tempfile.TemporaryDirectory() as place, silently(), undrawn:
        out = Path(place)
        log = _windy(out / "wind.csv") if folder == "made" else data_file(name)
        try:
            if command == "check":
                found = check(log, reading, out=out)
            elif command == "identify":
                found = identify([str(log)], MASSES[folder], "0.1262", out=out / "vehicle.yaml")
            elif command == "compare":
                before = sorted(log.parent.glob("normal_flight__E9_*"))
                found = compare([log], before, reading=reading, out=out)
            elif command == "diagnose":
                found = diagnose([log], reading=reading, out=out)
            else:
                found = estimate(log, reading, out=out)
        except InputError as refused:
            return str(refused).replace(f"{log.parent}/", "")
    return found["headline"].replace("\N{NO-BREAK SPACE}", " ")


if __name__ == "__main__":
    wanted = sys.argv[1:] or CASES
    known = json.loads(GOLDEN.read_bytes()) if GOLDEN.exists() else {}
    known |= {case: first_sentence(case) for case in CASES if case in wanted or case not in known}
    text = json.dumps({case: known[case] for case in CASES}, indent=1, ensure_ascii=False)
    GOLDEN.write_text(text + "\n", encoding="utf-8")
