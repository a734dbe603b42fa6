"""Tables of the columns that a map names: a vehicle hovers and climbs slowly."""

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.identification.logs.log_map import UNITS, load_map


def vehicle_of(name):
    """Return the name of the vehicle that hovers in a map's table."""
    return load_map(name).vehicle or "ardrone2"


def hover_columns(name, count=60, period=0.01):
    """Return the columns of a hover by their names, in the units of a map; numbers or (count,)
    arrays. Every column that the map names has values; ``recognise`` may name more, which hold 0.
    """
    log_map = load_map(name)
    vehicle = load_vehicle(vehicle_of(name))
    t = period * np.arange(count)
    columns = {log_map.time.column: t / UNITS["time"][log_map.time.unit]}
    for section, part in log_map.sections.items():
        values = _hover(section, part, t, vehicle.hover_rate)
        columns |= dict(zip(part.columns, values, strict=True))
    others = (column for part in log_map.extra.values() for column in part.columns)
    return dict.fromkeys((*log_map.recognise, *others), 0.0) | columns


def _hover(section, part, t, hover_rate):
    """Return a value for each column of a section of a map."""
    if section == "position":
        return np.array([0.0 * t, 0.0 * t, 1.0 + 0.01 * t]) / UNITS["position"][part.unit]
    if section == "attitude":
        return [0.0] * 3 if part.euler else [float(axis == "w") for axis in part.order]
    if section == "rotors":
        return [hover_rate / UNITS["rotors"][part.unit]] * 4
    if section == "commands":
        low, high = part.range
        return [low + 0.6 * (high - low)] * 4
    if section == "accelerometer":
        force = np.array([0.0 * t, 0.0 * t, 9.81 + 0.01 * np.sin(20.0 * t)])  # m/s2
        return force / (UNITS["accelerometer"][part.unit] * part.scale)
    if section == "gyro":
        return [1e-3 * np.sin(20.0 * t) / UNITS["gyro"][part.unit]] * 3
    return {"wrench": [0.33, 0.0, 0.0, 0.0], "battery": [3.9]}[section]  # N, Nm; V


def table_text(columns):
    """Return columns of numbers, or of arrays of one length, as CSV."""
    whole = np.broadcast_arrays(*map(np.asarray, columns.values()))
    lines = [",".join(f"{x:.17g}" for x in row) for row in np.stack(whole, axis=1).tolist()]
    return "\n".join([",".join(columns), *lines, ""]).encode()


def hover_table(name, **given):
    """Return a map's table of 40 rows as CSV; a keyword replaces a column, None leaves it out."""
    columns = hover_columns(name, 40, 0.004) | given
    return table_text({column: x for column, x in columns.items() if x is not None})
