"""What a flight itself says of its table's conventions, without any vehicle: each way to read the
pose is tried against the two balances that every quadrotor obeys.

The specific force points along the thrust axis, so ``a_h = (a_z + g) d_h / d_z`` with d the body's
z axis in the world, and its vertical part follows the rotors' thrust. And rotors on one side push
the body over to the other. How much of the motion a reading leaves unexplained is its cost; a field
is sure where every other value of it costs clearly more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from .log_map import ANGLE_UNITS, LENGTH_UNITS, RATE_UNITS
from .rotor_orders import Order

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PhysicsSettings:
    """How readings are compared."""

    period: float = 0.02  # s, of the common clock
    longest: float = 120.0  # s of the flight that are looked at, its middle
    cutoff_hz: float = 3.0  # of the motion: above, noise of twice differentiated poses is larger
    turn_cutoff_hz: float = 5.0  # of the angular velocity
    # of the angular acceleration: below, rotors balance steady moments of the air, which are larger
    # than what turns the body
    turn_band_hz: tuple[float, float] = (1.0, 8.0)
    blocks: int = 4  # parts of the flight, each of which must say the same
    good: float = 0.5  # share left unexplained up to which the best reading is believed
    clear: float = 0.2  # more left by another value of a field is clearly worse
    ratio: float = 1.5  # times more left, in every part of the flight, is too
    unit_slack: float = 0.15  # decades by which a gain may miss that of a unit: drag and delays
    prior: float = 0.01  # cost of what is less usual: decides nothing but ties
    upright: float = 0.5  # mean cosine of the thrust axis below which nothing flies
    order_left: float = 1.3  # of 2, the two torques
    order_clear: float = 0.25
    # rad/s of roll and pitch in that band: in hovers (0.08 in a simulated one) rotors answer
    # disturbances more than they turn the body, and the mirrored order may explain more
    least_turning: float = 0.12
    likely_left: float = 1.8  # the same of an order that is a guess, but a better one than the
    likely_clear: float = 0.05  # usual
    delays: tuple[int, ...] = (0, 1, 2, 3, 4, 5)  # periods by which a body answers its motors


PHYSICS = PhysicsSettings()
_G = 9.81
_TURN = np.array([1.0, -1.0, -1.0])  # half a turn about x


@dataclass(frozen=True, eq=False)
class _Reading:
    """One way to read a pose's columns, and how well it explains the flight."""

    values: dict[str, object]
    cost: float
    left: float  # share of the horizontal acceleration
    parts: Array  # the same in each part of the flight
    gain: float
    turns: Array  # (n, 3, 3) body to world in the kit's frames
    prior: float  # part of the cost: how unusual it is


@dataclass(frozen=True, eq=False)
class Pose:
    """The best reading of a pose's columns."""

    order: str
    sense: str
    world: str
    body: str
    unit: str
    euler: str
    pitch_sign: int
    length: str
    gain: float
    left: float
    sure_length: bool
    turns: Array  # (n, 3, 3)
    readings: tuple[_Reading, ...]

    def sure(self, name: str) -> bool:
        """Return whether every other value of a field explains the flight clearly less."""
        best = self.readings[0]
        if best.left > PHYSICS.good:
            return False
        for other in self.readings[1:]:
            if other.values[name] == best.values[name]:
                continue
            clear = other.cost - best.cost >= PHYSICS.clear
            steady = bool(np.all(other.parts > PHYSICS.ratio * best.parts))
            if not clear and not steady:
                return False
        return True

    def margin(self, name: str) -> str:
        """Return in words how much worse the next best value of a field is."""
        best = self.readings[0]
        if best.left > PHYSICS.good:
            return ""
        other = next((r for r in self.readings if r.values[name] != best.values[name]), None)
        return (
            ""
            if other is None
            else f", {other.values[name]} costs {other.cost - best.cost:.2f} more"
        )

    @property
    def frames_sure(self) -> bool:
        """Whether the body's turning is known: frames, sense and order."""
        return all(map(self.sure, ("world", "body", "sense", "order", "pitch_sign", "unit")))


class FlightPhysics:
    """A table's clock, and what is compared on it.

    Args:
        t: times (N,) in s of the rows; NaN where there is none.
        samples: rows that are looked at, at the most.
    """

    def __init__(self, t: Array, samples: int) -> None:
        self._t = t
        good = np.isfinite(t)
        begin, end = float(t[good].min()), float(t[good].max())
        middle, half = 0.5 * (begin + end), 0.5 * min(end - begin, PHYSICS.longest)
        count = max(2, int(2.0 * half / PHYSICS.period))
        self.grid: Array = np.asarray(
            middle - half + PHYSICS.period * np.arange(count, dtype=np.float64)
        )
        inside = np.flatnonzero(good & (t >= middle - half - 1.0) & (t <= middle + half + 1.0))
        self._rows = inside[:: max(1, len(inside) // samples)]
        self._turning = 0.0  # rad/s, of roll and pitch in the band of the turning

    @property
    def long_enough(self) -> bool:
        """Whether the clock is long enough for its filters."""
        return len(self.grid) > 150

    def _on_grid(self, values: Array, rows: NDArray[np.intp] | None = None) -> Array:
        """Return columns (N, k) of the rows on the common clock (n, k)."""
        rows = self._rows if rows is None else rows
        flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
        there = np.isfinite(flat).all(axis=1)
        t, flat = self._t[rows][there], flat[there]
        if len(t) < 2:
            return np.full((len(self.grid), flat.shape[1]), np.nan)
        return np.column_stack([np.interp(self.grid, t, column) for column in flat.T])

    def _smooth(self, values: Array, cutoff: float) -> Array:
        sos = butter(2, cutoff * 2.0 * PHYSICS.period, output="sos")
        return np.asarray(sosfiltfilt(sos, values, axis=0))

    def _band(self, values: Array) -> Array:
        low, high = (2.0 * PHYSICS.period * f for f in PHYSICS.turn_band_hz)
        sos = butter(2, [low, high], btype="band", output="sos")
        return np.asarray(sosfiltfilt(sos, values, axis=0))

    def _derivative(self, values: Array) -> Array:
        return np.asarray(np.gradient(values, PHYSICS.period, axis=0))

    def best_pose(
        self,
        position: Array,
        attitude: Array,
        motors: Array | None,
        orders: Sequence[str],
        units: Sequence[str],
        length: str,
        euler: bool,
        hint: str,
    ) -> Pose:
        """Return the reading of a pose that explains the flight best.

        Args:
            position: (N, 3) in the table's unit.
            attitude: (N, 4) or (N, 3), angles about x, y and z.
            motors: (N, 4) of any unit that grows with thrust, or None.
            orders: of a quaternion's columns, that may be.
            units: of angles, that may be.
            length: unit of the position, or nothing where it is not known.
            euler: whether the attitude is in angles.
            hint: the world that names speak for, or nothing.
        """
        acceleration = np.zeros((len(self.grid), 3))
        total = None
        if self.long_enough:
            place = self._smooth(self._on_grid(position[self._rows]), PHYSICS.cutoff_hz)
            acceleration = self._derivative(self._derivative(place))
            if motors is not None:
                power = np.square(np.abs(motors[self._rows])).sum(axis=1)
                total = self._smooth(self._on_grid(power[:, None]), PHYSICS.cutoff_hz)[:, 0]
        readings = []
        senses = ("body_to_world", "world_to_body")
        turns: Sequence[str] = ("zyx", "xyz") if euler else ("",)
        signs = (1, -1) if euler else (1,)
        for order, unit, turn, sign, sense in product(orders, units, turns, signs, senses):
            matrices = self._matrices(attitude, order, unit, turn, sign, sense)
            for world, body in product(("enu", "ned"), ("flu", "frd")):
                values: dict[str, object] = {
                    "order": order,
                    "unit": unit,
                    "euler": turn,
                    "pitch_sign": sign,
                    "sense": sense,
                    "world": world,
                    "body": body,
                }
                prior = PHYSICS.prior * sum(
                    (
                        order != orders[0],
                        turn == "xyz",
                        sign < 0,
                        sense != senses[0],
                        world != (hint or "enu"),
                        (world == "ned") != (body == "frd"),
                    )
                )
                readings.append(self._reading(values, matrices, acceleration, total, length, prior))
        readings.sort(key=lambda reading: reading.cost)
        if readings[0].left > PHYSICS.good:  # the flight does not tell: what is usual
            readings.sort(key=lambda reading: reading.prior)
        best = readings[0]
        unit, miss = self._length(best.gain, length)
        v = best.values
        return Pose(
            order=str(v["order"]),
            sense=str(v["sense"]),
            world=str(v["world"]),
            body=str(v["body"]),
            unit=str(v["unit"]),
            euler=str(v["euler"]),
            pitch_sign=-1 if v["pitch_sign"] == -1 else 1,
            length=unit,
            gain=best.gain,
            left=best.left,
            sure_length=best.left <= PHYSICS.good and miss <= PHYSICS.unit_slack,
            turns=best.turns,
            readings=tuple(readings),
        )

    def _matrices(
        self, attitude: Array, order: str, unit: str, turn: str, sign: int, sense: str
    ) -> Array:
        """Return rotation matrices (n, 3, 3) on the common clock, body to world in the table's
        frames.
        """
        values = attitude[self._rows]
        out = np.full((len(values), 3, 3), np.nan)
        if turn:
            good = np.isfinite(values).all(axis=1)
            angles = values[good] * ANGLE_UNITS[unit] * np.array([1.0, float(sign), 1.0])
            at = ["xyz".index(axis) for axis in turn]
            rotation = Rotation.from_euler(turn.upper(), angles[:, at])
        else:
            good = np.linalg.norm(np.nan_to_num(values), axis=1) > 0.5
            good &= np.isfinite(values).all(axis=1)
            rotation = Rotation.from_quat(values[good], scalar_first=order == "wxyz")
        if sense == "world_to_body":
            rotation = rotation.inv()
        out[good] = rotation.as_matrix()
        return self._on_grid(out).reshape(-1, 3, 3)

    def _reading(
        self,
        values: dict[str, object],
        matrices: Array,
        acceleration: Array,
        total: Array | None,
        length: str,
        prior: float,
    ) -> _Reading:
        world = _TURN if values["world"] == "ned" else np.ones(3)
        body = _TURN if values["body"] == "frd" else np.ones(3)
        turns = world[:, None] * matrices * body
        if not self.long_enough or not np.isfinite(turns).all():
            nothing = np.full(PHYSICS.blocks, 1.0)
            return _Reading(values, 1.0 + prior, 1.0, nothing, 1.0, turns, prior)
        axis = self._smooth(turns[:, :, 2], PHYSICS.cutoff_hz)
        a = acceleration * world
        up = np.clip(axis[:, 2], 0.2, None)
        tilt = _G * axis[:, :2] / up[:, None]
        tilt = tilt - tilt.mean(axis=0)
        need = a[:, :2] - a[:, :2].mean(axis=0)
        power = float(np.sum(tilt * tilt))
        gain = max(float(np.sum(tilt * need)) / power, 0.0) if power > 0.0 else 0.0
        squares = np.sum(np.square(need - gain * tilt), axis=1)
        whole = np.sum(np.square(need), axis=1)
        left = float(squares.sum() / max(whole.sum(), 1e-300))
        parts = np.array(
            [
                s.sum() / max(w.sum(), 1e-300)
                for s, w in zip(
                    np.array_split(squares, PHYSICS.blocks),
                    np.array_split(whole, PHYSICS.blocks),
                    strict=True,
                )
            ]
        )
        cost = left + prior
        if total is not None and np.std(total) > 0.0 and np.std(a[:, 2]) > 0.0:
            cost += 0.5 * (1.0 - float(np.corrcoef(a[:, 2], total * axis[:, 2])[0, 1]))
        if float(np.mean(axis[:, 2])) < PHYSICS.upright:
            cost += 2.0
        if gain > 0.0:
            cost += 2.0 * max(0.0, self._length(gain, length)[1] - PHYSICS.unit_slack)
        return _Reading(values, cost, left, parts, gain, turns, prior)

    @staticmethod
    def _length(gain: float, named: str) -> tuple[str, float]:
        """Return the unit of length that a gain of the accelerations speaks for, and by how many
        decades the gain misses it.
        """
        units = [named] if named else ["m", "cm", "mm"]
        if gain <= 0.0:
            return units[0], 9.0
        misses = {unit: abs(np.log10(gain * LENGTH_UNITS[unit])) for unit in units}
        best = min(misses, key=lambda unit: misses[unit])
        return best, float(misses[best])

    def pose_rates(self, pose: Pose) -> Array:
        """Return angular velocities (n, 3) in rad/s, body, of a pose's attitude."""
        change = self._derivative(pose.turns.reshape(-1, 9)).reshape(-1, 3, 3)
        skew = np.einsum("nji,njk->nik", pose.turns, change)
        return np.column_stack(
            [
                0.5 * (skew[:, 2, 1] - skew[:, 1, 2]),
                0.5 * (skew[:, 0, 2] - skew[:, 2, 0]),
                0.5 * (skew[:, 1, 0] - skew[:, 0, 1]),
            ]
        )

    def gyro(self, values: Array, pose: Pose, named: str) -> tuple[str, str, bool, str]:
        """Return a gyro's unit and body axes, whether they are sure, and why.

        Args:
            values: (N, 3) as they stand.
            pose: the best reading.
            named: its unit, or nothing.
        """
        units = [named] if named else ["rad/s", "deg/s"]
        if not self.long_enough:
            return units[0], "flu", False, "the log is too short"
        need = self._smooth(self.pose_rates(pose), PHYSICS.turn_cutoff_hz)
        seen = self._smooth(self._on_grid(values[self._rows]), PHYSICS.turn_cutoff_hz)
        need, seen = need - need.mean(axis=0), seen - seen.mean(axis=0)
        size = max(float(np.sum(need * need)), 1e-300)
        shares = {}
        for unit, body in product(units, ("flu", "frd")):
            turned = seen * RATE_UNITS[unit] * (_TURN if body == "frd" else 1.0)
            shares[unit, body] = float(np.sum(np.square(need - turned))) / size
        ranked = sorted(shares.items(), key=lambda item: item[1])
        (unit, body), left = ranked[0]
        sure = pose.frames_sure and left < PHYSICS.good and ranked[1][1] - left > PHYSICS.clear
        return unit, body, sure, f"{left:.0%} of the attitude's rate is left unexplained"

    def rates_of(self, gyro: Array, unit: str, body: str) -> Array | None:
        """Return a gyro's angular velocities (n, 3) in rad/s and the kit's body axes."""
        seen = self._on_grid(gyro[self._rows])
        if not np.isfinite(seen).all():
            return None
        return np.asarray(seen * RATE_UNITS[unit] * (_TURN if body == "frd" else 1.0))

    def orders(self, thrusts: Array, pose: Pose | None, rates: Array | None) -> dict[Order, float]:
        """Return how much of the roll and pitch accelerations each order of the motors leaves
        unexplained, 0 to 2; nothing where the body's turning is not known.

        Args:
            thrusts: (N, 4) of the columns, growing with thrust.
            pose: the best reading, where there is one.
            rates: (n, 3) angular velocities by a gyro, where there is one.
        """
        if rates is None and pose is not None:
            if not pose.frames_sure:
                return {}
            rates = self.pose_rates(pose)
        if rates is None or not self.long_enough or not np.isfinite(rates).all():
            return {}
        turning = self._band(self._derivative(rates))[:, :2]
        self._turning = float(np.sqrt(np.mean(np.square(self._band(rates)[:, :2]))))
        push = self._band(self._on_grid(thrusts[self._rows]))
        if not np.isfinite(push).all():
            return {}
        out: dict[Order, float] = {}
        for delay in PHYSICS.delays:
            y = turning[delay:] - turning[delay:].mean(axis=0)
            x = push[: len(push) - delay]
            x = x - x.mean(axis=0)
            size = np.maximum(np.sum(y * y, axis=0), 1e-300)
            cross, gram = x.T @ y, x.T @ x
            for a, b, c, d in permutations(range(4)):
                left = 0.0
                for k, (plus, minus) in enumerate((((a, b), (c, d)), ((b, c), (a, d)))):
                    s = np.zeros(4)
                    s[list(plus)], s[list(minus)] = 1.0, -1.0
                    power = max(float(s @ gram @ s), 1e-300)
                    left += 1.0 - max(float(s @ cross[:, k]), 0.0) ** 2 / (power * size[k])
                order = (a + 1, b + 1, c + 1, d + 1)
                out[order] = min(out.get(order, 2.0), float(left))
        return out

    @staticmethod
    def likely_order(left: float, second: float) -> bool:
        """Return whether an order is likelier than what is usual, though it is not sure."""
        return left <= PHYSICS.likely_left and second - left >= PHYSICS.likely_clear

    def sure_order(self, left: float, second: float) -> bool:
        """Return whether an order is sure, of what it and the next best leave, once ``orders`` has
        seen how much the body turns.
        """
        enough = self._turning >= PHYSICS.least_turning
        clear = second - left >= PHYSICS.order_clear
        return enough and left <= PHYSICS.order_left and clear
