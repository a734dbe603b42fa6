"""Columns that were sampled together, and what they hold in the kit's units, axes and order of
rotors.

With W from the log's world and B from its body axes to this kit's, positions become W p, attitudes
W R B' and what a sensor measures B v.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .log_map import UNITS, Attitude, Battery, Columns, Commands, LogMap, Rotors, Sensor, constant
from .table import Array, Mask, Rows, Table, finite_rows

_HALF_TURN = np.diag([1.0, -1.0, -1.0])
# from the log's world, or its body axes, to the kit's
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
WORLD_TURNS: dict[str, Array] = {"enu": np.eye(3), "ned": _HALF_TURN, "y_up": _Y_UP}
BODY_TURNS: dict[str, Array] = {"flu": np.eye(3), "frd": _HALF_TURN, "y_up": _Y_UP}


@dataclass(frozen=True, eq=False)
class Samples:
    """Columns that were sampled together: rows in the order of time."""

    t: Array  # (N,) s
    columns: Mapping[str, Array]  # by name (N,); NaN where there is no value
    topic: str = ""  # of the message in which they stood, where a log has several
    table: Table | None = None  # in which they stand
    rows: Rows | None = None  # (N,) of it

    @property
    def beside(self) -> tuple[Sequence[str], Callable[[Sequence[str]], Mapping[str, Array]]]:
        """The names of all columns of their table or message, and what reads some of these."""
        if self.table is not None:
            return self.table.numeric or self.table.header, self.table.read
        return list(self.columns), lambda names: {name: self.columns[name] for name in names}

    def values(self, part: Columns) -> Array:
        """Return a section's columns (N, k), with their signs and scale; a constant such as ``=0``
        in every row.
        """
        values = np.empty((len(self.t), len(part.columns)))
        for i, name in enumerate(part.columns):
            fixed = constant(name)
            values[:, i] = self.columns[name] if fixed is None else fixed
        return scaled(part, values)

    def there(self, part: Columns) -> Mask:
        """Return in which rows (N,) a section has all of its values."""
        return finite_rows(self.values(part))

    def has(self, part: Columns) -> bool:
        """Return whether a section's columns are there."""
        return part.topic in ("", self.topic) and set(part.named) <= set(self.columns)

    def cut(self, keep: slice | Mask | Rows) -> "Samples":
        """Return some of the rows."""
        columns = {name: column[keep] for name, column in self.columns.items()}
        rows = None if self.rows is None else self.rows[keep]
        return replace(self, t=self.t[keep], columns=columns, rows=rows)

    def place(self, index: int) -> str:
        """Return where a sample stands, for errors: the table's row, else its time."""
        if self.table is None or self.rows is None:
            return f"at {self.t[index]:.6g} s"
        return self.table.row(int(self.rows[index]))


def scaled(part: Columns, values: Array) -> Array:
    """Return what columns (N, k) hold, with the section's signs and scale."""
    signs = np.array(part.signs, dtype=np.float64) if part.signs else 1.0
    return np.asarray(values * signs * part.scale)


def in_kit_units(log_map: LogMap, section: str, part: Columns, values: Array) -> Array:
    """Return a section's scaled values (N, k), but no attitude's, in SI units, and in the kit's
    axes and order of rotors; commands as 0 to 1.
    """
    unit = UNITS.get(section, {}).get(part.unit, 1.0)
    if isinstance(part, Rotors):
        return np.asarray(values[:, [m - 1 for m in part.order]] * (unit / part.pole_pairs))
    if isinstance(part, Commands):
        assert part.range is not None
        low, high = part.range
        return np.asarray((values[:, [m - 1 for m in part.order]] - low) / (high - low))
    if isinstance(part, Battery):
        return np.asarray(values * unit * part.cells)
    if isinstance(part, Sensor):
        return np.asarray(values * unit @ BODY_TURNS[part.body or log_map.body].T)
    return values if section == "wrench" else values * unit @ WORLD_TURNS[log_map.world].T


def quaternions(part: Attitude, values: Array) -> Array:
    """Return the quaternions (N, 4), scalar first, that an attitude's columns (N, k) stand for, in
    their own axes and of the length that they have.
    """
    if not part.euler:
        return values[:, [part.order.index(name) for name in "wxyz"]]
    order = ["xyz".index(axis) for axis in part.euler]
    turn = Rotation.from_euler(part.euler.upper(), values[:, order] * UNITS["attitude"][part.unit])
    return np.asarray(turn.as_quat(scalar_first=True))


def in_kit_axes(log_map: LogMap, part: Attitude, attitude: Array) -> Array:
    """Return quaternions (N, 4) of length 1 as turns from the kit's body axes to its world."""
    if part.sense == "world_to_body":
        attitude = attitude * np.array([1.0, -1.0, -1.0, -1.0])
    if log_map.world == "enu" and log_map.body == "flu":
        return attitude
    if log_map.world == "ned" and log_map.body == "frd":  # of any length, NaN included
        return np.asarray(attitude * np.array([1.0, 1.0, -1.0, -1.0]))
    matrix = Rotation.from_quat(attitude, scalar_first=True).as_matrix()
    turn = Rotation.from_matrix(WORLD_TURNS[log_map.world] @ matrix @ BODY_TURNS[log_map.body].T)
    return np.asarray(turn.as_quat(scalar_first=True))
