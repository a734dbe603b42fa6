"""Winds on a grid in time and space: from a file, or sampled from any other wind.

A file is ``.npz`` with ``t`` (s), ``x``, ``y``, ``z`` (m), each (n,) and evenly spaced, and
``wind`` (t, x, y, z, 3) m/s. A netCDF file (``.nc``, needs xarray) has the coordinates ``time``,
``x``, ``y``, ``z`` in the same units, and the variables ``u``, ``v``, ``w`` in any order of
dimensions. A file without a time is steady.
"""

import io
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...runtime.arrays import Array
from ...runtime.errors import InputError
from ...runtime.extras import need
from ...runtime.regular_files import check_archive, read_bytes, reading
from ...runtime.whole_files import replaced
from .field import CompiledWind, Wind

AXES = ("t", "x", "y", "z")
_LARGEST = 400_000_000  # bytes of a grid in memory


GRID = np.dtype(
    [
        ("first", "f8", (4,)),  # s and m, the grid's beginning: t, x, y, z
        ("step", "f8", (4,)),  # likewise, from point to point
        ("field", "i8"),  # address of the velocities (*counts, 3) m/s
        ("counts", "i8", (4,)),  # points along each
    ]
)


class GridWind(CompiledWind):
    """A wind on a grid, interpolated linearly; beyond an end as at the end.

    Args:
        axes: times (s) and places (m) of the grid along x, y and z, each (n,), evenly spaced.
        wind: (t, x, y, z, 3) m/s.
        where: named in errors.

    Raises:
        InputError: shapes do not fit, axes are not even, or numbers are not finite.
    """

    def __init__(
        self,
        axes: Sequence[ArrayLike],
        wind: ArrayLike,
        where: str = "GridWind",
    ) -> None:
        self.axes = tuple(np.asarray(axis, dtype=np.float64) for axis in axes)
        self.wind = np.ascontiguousarray(wind, dtype=np.float64)
        for name, axis in zip(AXES, self.axes, strict=True):
            if axis.ndim != 1 or len(axis) == 0 or not np.all(np.isfinite(axis)):
                raise InputError(f"{where}: {name} must be finite numbers, shape (n,)")
            steps = np.diff(axis)
            if len(steps) and (steps.min() <= 0.0 or np.ptp(steps) > 1e-6 * steps.mean()):
                raise InputError(f"{where}: {name} must grow in even steps")
        shape = (*[len(axis) for axis in self.axes], 3)
        if self.wind.shape != shape:
            raise InputError(
                f"{where}: wind must have the shape {shape} (t, x, y, z, 3), got {self.wind.shape}"
            )
        if not np.all(np.isfinite(self.wind)):
            raise InputError(f"{where}: wind must be finite numbers in m/s")
        first = [axis[0] for axis in self.axes]
        widths = [np.ptp(axis) / (len(axis) - 1) if len(axis) > 1 else 1.0 for axis in self.axes]
        parameters = np.array([(first, widths, 0, shape[:4])], dtype=GRID)
        super().__init__("grid", parameters, {"field": self.wind})


def on_grid(
    wind: Wind, low: ArrayLike, high: ArrayLike, step: float, times: ArrayLike = (0.0,)
) -> GridWind:
    """Return any wind as a compiled one, sampled on a grid.

    Args:
        wind: with ``velocity(points (n, 3), time) -> (n, 3)``.
        low: (3,) m, a corner of the box.
        high: (3,) m, the opposite corner.
        step: largest distance from point to point, m.
        times: (n,) s, evenly spaced.

    Raises:
        InputError: no box, too large a grid, or a wind of another shape.
    """
    a, b = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    when = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if a.shape != (3,) or b.shape != (3,) or not np.all(b > a) or not step > 0.0:
        raise InputError(
            f"on_grid: expected a box from low (3,) to high (3,) and a step above 0, got {low!r}, "
            f"{high!r} and {step!r}"
        )
    counts = np.ceil((b - a) / step - 1e-9).astype(int) + 1
    if 24 * float(np.prod(counts, dtype=np.float64)) * len(when) > _LARGEST:
        raise InputError(
            f"on_grid: {len(when)} times {' x '.join(map(str, counts))} points are too many; take "
            f"a larger step, a smaller box or fewer times"
        )
    x, y, z = (np.linspace(a[i], b[i], counts[i]) for i in range(3))
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    rows = []
    for t in when:
        row = np.asarray(wind.velocity(points, float(t)), dtype=np.float64)
        if row.shape != points.shape:
            raise InputError(
                f"on_grid: velocity must return {points.shape} for points {points.shape}, got "
                f"{row.shape}"
            )
        rows.append(row.reshape(*counts, 3))
    return GridWind((when, x, y, z), np.array(rows), "on_grid")


def read_wind(path: str | Path) -> GridWind:
    """Read a wind from ``.npz`` or netCDF (``.nc``).

    Raises:
        InputError: no such file, another form, a missing field, or no xarray for netCDF.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file}: no such file; expected a wind on a grid, .npz or .nc")
    if file.suffix not in (".npz", ".nc", ".nc4", ".cdf"):
        raise InputError(f"{file}: expected .npz or .nc")
    read, what = (_read_npz, "arrays") if file.suffix == ".npz" else (_read_netcdf, "netCDF")
    with reading(file, what):
        axes, wind = read(file)
    return GridWind(axes, wind, str(file))


def _read_npz(file: Path) -> tuple[list[Array], Array]:
    data = io.BytesIO(read_bytes(file, "a wind", _LARGEST))
    check_archive(file, data, _LARGEST, "a wind")
    with np.load(data, allow_pickle=False) as arrays:
        fields = {name: np.asarray(arrays[name], dtype=np.float64) for name in arrays.files}
    fields.setdefault("t", np.zeros(1))
    for name in (*AXES, "wind"):
        if name not in fields:
            raise InputError(
                f"{file}: lacks {name!r}; expected t (s), x, y, z (m) and wind (t, x, y, z, 3) m/s"
            )
    wind = fields["wind"]
    return [fields[name] for name in AXES], wind[None] if wind.ndim == 4 else wind


def _xarray() -> Any:
    need("xarray", "wind", "wind: netCDF (.npz files need nothing)")
    return import_module("xarray")


def _read_netcdf(file: Path) -> tuple[list[Array], Array]:
    with _xarray().open_dataset(file, decode_times=False) as data:
        if missing := [n for n in ("u", "v", "w", "x", "y", "z") if n not in data.variables]:
            raise InputError(
                f"{file}: lacks {missing[0]!r}; expected u, v, w (m/s) over time (s), x, y, z (m)"
            )
        names = [n for n in ("time", "x", "y", "z") if n in data.dims]
        axes = [np.asarray(data[n].values, dtype=np.float64) for n in names]
        parts = [data[n].transpose(*names).values for n in ("u", "v", "w")]
    wind = np.stack(parts, axis=-1)
    return (axes, wind) if "time" in names else ([np.zeros(1), *axes], wind[None])


def write_wind(wind: GridWind, path: str | Path) -> Path:
    """Write a wind as ``.npz`` or netCDF, at once or not at all; return the path.

    Raises:
        InputError: another ending, or no xarray for netCDF.
    """
    file = Path(path)
    if file.suffix not in (".npz", ".nc"):
        raise InputError(f"{file}: expected .npz or .nc")
    t, x, y, z = wind.axes
    with replaced(file) as partial:
        if file.suffix == ".npz":
            with partial.open("wb") as out:
                np.savez_compressed(out, t=t, x=x, y=y, z=z, wind=wind.wind)
        else:
            dims = ("time", "x", "y", "z")
            data = _xarray().Dataset(
                {name: (dims, wind.wind[..., i]) for i, name in enumerate("uvw")},
                coords={"time": t, "x": x, "y": y, "z": z},
            )
            data.to_netcdf(partial)
    return file
