"""Shared parts of effect models, on the pointers given to a model."""

import math
from typing import Any

from ...runtime.compiled import compiled
from .base import (
    COM,
    POSITION,
    RATE,
    ROTATION,
    ROTOR_POSITION,
    ROTOR_RADIUS,
    ROTOR_THRUST,
    SAMPLE_QUATERNION,
    VELOCITY,
    WIND,
)

_SPACING = 0.0045  # s, least time between two kept entries of a delay line
# largest ratio of the longest of three steps to the shortest, for a cubic through all four
_EVEN = 2.5

# An array of a C function, in the layout of base.py
Pointer = Any


@compiled
def rotor_place(vehicle: Pointer, i: int, central: float) -> tuple[float, float, float]:
    """Return where rotor ``i`` stands, m from the geometric centre; ``central`` draws it there."""
    share, at = 1.0 - central, ROTOR_POSITION + 3 * i
    return share * vehicle[at], share * vehicle[at + 1], share * vehicle[at + 2]


@compiled
def air_velocity(state: Pointer, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the velocity through the air, in body axes, of the body's point (x, y, z) m from the
    geometric centre.
    """
    ax = state[VELOCITY] - state[WIND]
    ay = state[VELOCITY + 1] - state[WIND + 1]
    az = state[VELOCITY + 2] - state[WIND + 2]
    wx, wy, wz = state[RATE], state[RATE + 1], state[RATE + 2]
    ux = (
        state[ROTATION] * ax + state[ROTATION + 3] * ay + state[ROTATION + 6] * az + wy * z - wz * y
    )
    uy = (
        state[ROTATION + 1] * ax
        + state[ROTATION + 4] * ay
        + state[ROTATION + 7] * az
        + wz * x
        - wx * z
    )
    uz = (
        state[ROTATION + 2] * ax
        + state[ROTATION + 5] * ay
        + state[ROTATION + 8] * az
        + wx * y
        - wy * x
    )
    return ux, uy, uz


@compiled
def add_force_at(
    vehicle: Pointer,
    state: Pointer,
    wrench: Pointer,
    x: float,
    y: float,
    z: float,
    fx: float,
    fy: float,
    fz: float,
) -> None:
    """Add a force (fx, fy, fz) N in body axes at the body's point (x, y, z) m from the geometric
    centre to ``wrench``.
    """
    for i in range(3):
        wrench[i] += (
            state[ROTATION + 3 * i] * fx
            + state[ROTATION + 3 * i + 1] * fy
            + state[ROTATION + 3 * i + 2] * fz
        )
    x -= vehicle[COM]
    y -= vehicle[COM + 1]
    z -= vehicle[COM + 2]
    wrench[3] += y * fz - z * fy
    wrench[4] += z * fx - x * fz
    wrench[5] += x * fy - y * fx


@compiled
def lift_near_plane(
    c: Pointer, vehicle: Pointer, state: Pointer, wrench: Pointer, height: float, side: float
) -> None:
    """Add the thrust that rotors gain near a level plane at ``height`` m, with ``c`` (2,) its
    strength and ``central``; ``side`` is +1 where they are above the plane and -1 below.
    """
    scale = c[0] * (0.25 * vehicle[ROTOR_RADIUS]) ** 2
    total = 0.0
    for i in range(4):
        x, y, z = rotor_place(vehicle, i, c[1])
        away = state[POSITION + 2] - height
        away += state[ROTATION + 6] * x + state[ROTATION + 7] * y + state[ROTATION + 8] * z
        away *= side
        ratio = min(scale / (away * away), 0.5) if away > 1e-3 else 0.5
        extra = state[ROTOR_THRUST + i] * ratio / (1.0 - ratio)
        wrench[3] += (y - vehicle[COM + 1]) * extra
        wrench[4] -= (x - vehicle[COM]) * extra
        total += extra
    for i in range(3):
        wrench[i] += state[ROTATION + 3 * i + 2] * total


@compiled
def turn_attitude(sample: Pointer, rx: float, ry: float, rz: float) -> None:
    """Turn the attitude of a sample about the world's axes by the rotation vector
    (rx, ry, rz) rad.
    """
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    scale = math.sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    a, x, y, z = math.cos(0.5 * angle), scale * rx, scale * ry, scale * rz
    q = SAMPLE_QUATERNION
    b, u, v, w = sample[q], sample[q + 1], sample[q + 2], sample[q + 3]
    sample[q] = a * b - x * u - y * v - z * w
    sample[q + 1] = a * u + x * b + y * w - z * v
    sample[q + 2] = a * v - x * w + y * b + z * u
    sample[q + 3] = a * w + x * v - y * u + z * b


@compiled
def delay(
    memory: Pointer, width: int, capacity: int, wanted: float, values: Pointer, at: int
) -> None:
    """Replace ``width`` numbers of ``values`` from ``at`` on by what they were ``wanted`` s ago.

    ``memory`` is the delay line: the number of entries, the time since the last new one (summed by
    the caller), and the entries. The newest is first; an entry is an age and its numbers. Between
    entries runs the cubic through the nearest four, within their range. A line between two would
    damp noise by its distance from both. The best fit of a noisy log would be the delay with most
    damping. Four unevenly spaced entries get a line; before the oldest the value is held. A delay
    line fed faster than 200 Hz keeps at most 200 entries a second.
    """
    size = width + 1
    count = int(memory[0])
    for j in range(count):
        memory[2 + j * size] += memory[1]
    memory[1] = 0.0
    if count < 2 or memory[2 + size] >= _SPACING:
        count = min(count + 1, capacity)
        for j in range(count - 1, 0, -1):
            for i in range(size):
                memory[2 + j * size + i] = memory[2 + (j - 1) * size + i]
        memory[0] = count
    memory[2] = 0.0
    for i in range(width):
        memory[3 + i] = values[at + i]
    j = 0
    while j < count - 1 and memory[2 + j * size] < wanted:
        j += 1
    here = 2 + j * size
    share = 0.0
    if j > 0 and memory[here] >= wanted:
        share = (memory[here] - wanted) / (memory[here] - memory[here - size])
    first = 2 + min(max(j - 2, 0), count - 4) * size
    a, b, c, d = 1.0, 0.0, 0.0, 0.0
    cubic = share > 0.0 and count >= 4
    if cubic:
        p, q, r, s = (
            memory[first],
            memory[first + size],
            memory[first + 2 * size],
            memory[first + 3 * size],
        )
        cubic = max(q - p, r - q, s - r) <= _EVEN * min(q - p, r - q, s - r)
        if cubic:  # Lagrange's weights
            a = (wanted - q) * (wanted - r) * (wanted - s) / ((p - q) * (p - r) * (p - s))
            b = (wanted - p) * (wanted - r) * (wanted - s) / ((q - p) * (q - r) * (q - s))
            c = (wanted - p) * (wanted - q) * (wanted - s) / ((r - p) * (r - q) * (r - s))
            d = (wanted - p) * (wanted - q) * (wanted - r) / ((s - p) * (s - q) * (s - r))
    for i in range(width):
        late = memory[here + 1 + i]
        if cubic:
            one = first + 1 + i
            w, x, y, z = (
                memory[one],
                memory[one + size],
                memory[one + 2 * size],
                memory[one + 3 * size],
            )
            value = a * w + b * x + c * y + d * z
            values[at + i] = min(max(value, min(w, x, y, z)), max(w, x, y, z))
        else:
            values[at + i] = (
                late if share == 0.0 else late + share * (memory[here - size + 1 + i] - late)
            )
