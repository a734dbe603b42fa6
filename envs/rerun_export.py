"""A flight as a recording for the Rerun viewer: pose, path, the wrench as arrows, and every number
over time.
"""

from pathlib import Path

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.extras import need
from ..runtime.whole_files import replaced
from .replay import Flight, arrow_scales

_ESTIMATED, _TRUE, _ROTOR, _FAN = (230, 38, 26), (26, 140, 51), (64, 72, 84), (51, 89, 140)


def write_rrd(flight: Flight, vehicle: Vehicle, path: Path) -> None:
    """Write a flight as ``.rrd``, whole or not at all; open it with ``rerun FILE``.

    Raises:
        InputError: the rerun extra is not installed, or the file cannot be written.
    """
    need("rerun", "rerun", path)
    import rerun as rr

    recording = rr.RecordingStream("windwrench")
    with replaced(path) as partial:
        recording.save(partial)
        recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        discs = rr.Ellipsoids3D(
            centers=vehicle.positions,
            half_sizes=[[0.8 * vehicle.arm_l] * 2 + [0.05 * vehicle.arm_l]] * 4,
            colors=[_ROTOR],
            fill_mode="solid",
        )
        recording.log("world/vehicle/rotors", discs, static=True)
        recording.log(
            "world/path", rr.LineStrips3D([flight.position], colors=[(242, 115, 26)]), static=True
        )
        time = rr.TimeColumn("time", duration=flight.t - flight.t[0])
        turned = flight.quaternion[:, [1, 2, 3, 0]]
        recording.send_columns(
            "world/vehicle",
            [time],
            rr.Transform3D.columns(translation=flight.position, quaternion=turned),
        )
        scale, _ = arrow_scales(flight, vehicle.arm_l)
        for is_true, force, torque in flight.wrenches:
            name, colour = ("true", _TRUE) if is_true else ("estimated", _ESTIMATED)
            recording.log(
                f"world/force/{name}", rr.Arrows3D.from_fields(colors=[colour]), static=True
            )
            recording.send_columns(
                f"world/force/{name}",
                [time],
                rr.Arrows3D.columns(origins=flight.position, vectors=scale * force),
            )
            for quantity, values in (("force", force), ("torque", torque)):
                for i, axis in enumerate("xyz"):
                    recording.send_columns(
                        f"{quantity}_{axis}/{name}",
                        [time],
                        rr.Scalars.columns(scalars=values[:, i]),
                    )
        if flight.fan_y is not None:
            height = float(np.median(flight.position[:, 2]))
            mouth = np.column_stack(
                [0.0 * flight.fan_y, flight.fan_y, np.full(len(flight.t), height)]
            )
            ring = rr.Ellipsoids3D(
                centers=[[0, 0, 0]], half_sizes=[[0.05, 0.5, 0.5]], colors=[_FAN], fill_mode="solid"
            )
            recording.log("world/fan", ring, static=True)
            recording.send_columns("world/fan", [time], rr.Transform3D.columns(translation=mouth))
        recording.flush()
        recording.disconnect()
