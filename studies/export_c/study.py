"""Agreement of C and Python along five flights, and sizes and instructions on a Cortex-M4F."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.live.export_c import ESTIMATORS, PRECISIONS, export_c, exportable_policy
from windwrench.runtime.provenance import commit
from windwrench.studies.export_c import firmware, webassembly
from windwrench.studies.export_c.compiled import CompiledFilter, compare
from windwrench.studies.export_c.flights import FLIGHTS, flight, vehicle_of

BOARD_STEPS = 1_000
BOARD_FLIGHT = "ardrone2, turning"
POLICIES = ("lead", "sac-0", "tracker")
_POLICY = Path(__file__).parents[2] / "training" / "policies" / "sac-0.npz"


def run(steps: int, seed: int, report: Callable[[str, float], None]) -> dict[str, Any]:
    """Return the results of ``steps`` of each flight with every filter, and of the board.

    Raises:
        RuntimeError: a compiler or the board fails.
    """
    made = commit()
    with tempfile.TemporaryDirectory() as folder:
        agreement = _agreement(steps, seed, Path(folder), report)
        return {
            "commit": made,
            "steps": steps,
            "seed": seed,
            "agreement": agreement,
            "board": _board(seed, Path(folder), report),
            "browser": _browser(seed, Path(folder)),
        }


def _agreement(
    steps: int, seed: int, folder: Path, report: Callable[[str, float], None]
) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for estimator in ESTIMATORS:
        for name in FLIGHTS:
            flown = flight(name, steps, seed)
            row: dict[str, Any] = {"estimator": estimator, "flight": name}
            for precision in PRECISIONS:
                exported = export_c(vehicle_of(name), estimator, precision=precision)
                c = CompiledFilter(exported, folder / f"{precision}{len(rows)}")
                worst = compare(c, exported.filter, flown)
                row[precision] = {key: float(f"{value:.3g}") for key, value in worst.items()}
            rows.append(row)
            report("flights", len(rows) / (len(ESTIMATORS) * len(FLIGHTS)))
    return rows


def _board(seed: int, folder: Path, report: Callable[[str, float], None]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for estimator in ESTIMATORS:
        exported = export_c(vehicle_of(BOARD_FLIGHT), estimator)
        for optimise in ("-O2", "-Os"):
            here = folder / f"board{len(rows)}"
            calm = firmware.fly(
                exported, flight(BOARD_FLIGHT, BOARD_STEPS, seed, faults=False), here, optimise
            )
            hard_flight = flight(BOARD_FLIGHT, BOARD_STEPS, seed)
            for name in ("position", "quaternion"):  # a gap that surely comes in a calm second
                hard_flight[name][60:120] = np.nan
            hard = firmware.fly(exported, hard_flight, here, optimise)
            row: dict[str, Any] = {
                "estimator": estimator,
                "optimise": optimise,
                "code": calm.code,
                "tables": calm.tables,
                "ram": calm.ram,
                "stack": calm.stack,
                "stack_with_faults": hard.stack,
                "predict": float(np.median(calm.predict)),
                "correct": float(np.median(calm.correct)),
                "longest_call": float(max(hard.predict.max(), hard.correct.max())),
                "loop_of_2000": calm.loop,
            }
            if estimator != "constant-gain":
                felt = flight(BOARD_FLIGHT, BOARD_STEPS, seed, faults=False, imu=True)
                felt_row = firmware.fly(exported, felt, here, optimise)
                row["with_imu"] = {
                    "predict": float(np.median(felt_row.predict)),
                    "correct": float(np.median(felt_row.correct)),
                    "imu": float(np.median(felt_row.imu)),
                }
            if optimise == "-Os":
                row["policies"] = [_policy(name, estimator, here, calm.code) for name in POLICIES]
            rows.append(row)
            report("board", len(rows) / (2 * len(ESTIMATORS)))
    return rows


def _browser(seed: int, folder: Path) -> list[dict[str, Any]]:
    """Return the bytes of each filter as WebAssembly, and how far it is from C for this machine."""
    rows = []
    for estimator in ESTIMATORS:
        exported, flown = (
            export_c(vehicle_of(BOARD_FLIGHT), estimator),
            flight(BOARD_FLIGHT, 2_000, seed),
        )
        here = folder / f"browser-{estimator}"
        size, said = webassembly.fly(exported, flown, here)
        apart, statuses = webassembly.apart(said, exported, flown, here)
        rows.append(
            {"estimator": estimator, "bytes": size, "apart": float(f"{apart:.3g}")}
            | {"status": statuses, "steps": len(said)}
        )
    return rows


def _policy(name: str, estimator: str, folder: Path, alone: int) -> dict[str, Any]:
    """Return what a policy takes beside the filter of ``alone`` bytes."""
    policy = exportable_policy(name, _POLICY if name == "sac-0" else None)
    both = export_c(vehicle_of(BOARD_FLIGHT), estimator, policy=policy)
    flown = firmware.fly(both, flight(BOARD_FLIGHT, BOARD_STEPS, 0, faults=False), folder, "-Os")
    return {
        "name": name,
        "code": flown.code - alone,
        "ram": flown.policy_ram,
        "decision": flown.policy,
    }
