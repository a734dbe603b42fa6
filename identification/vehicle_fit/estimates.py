"""From fitted parameters to what is said of a vehicle: values with intervals, and what is assumed
where the flight does not tell.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from ...dynamics.effects import Role, get
from .channels import MotionPiece, Sources
from .effect_settings import effect_of, estimate_name
from .geometry import USUAL, Geometry
from .parameters import OPTIONAL
from .result import ASSUMED, GIVEN, IDENTIFIED, NOTHING, Estimate, Hidden, told
from .solve import VehicleFit

Values = Mapping[str, float]
Function = Callable[[Values], float]
Interval = tuple[float, float, float]  # value, low and high

# of each further effect of the air: its role, its first coefficient there, and what shows it
AIR: dict[str, tuple[Role, int, str]] = {
    "rotor drag": (Role.ROTOR_DRAG, 0, ""),
    "linear drag": (Role.BODY_DRAG, 0, ""),
    "quadratic drag": (Role.BODY_DRAG, 3, ""),
    "vertical drag": (Role.BODY_DRAG, 2, ""),
    "inflow": (Role.INFLOW_THRUST, 0, "z"),
    "lift": (Role.TRANSLATIONAL_LIFT, 0, "z"),
    **{f"damping {a}": (Role.RATE_DAMPING, i, "turning") for i, a in enumerate("xyz")},
    "flapping": (Role.FLAPPING_MOMENT, 0, "turning"),
}
UNKNOWN: Interval = (math.nan, math.nan, math.nan)


class Intervals:
    """Values and 95 % intervals of a fit's parameters, and of what follows from them."""

    def __init__(self, fit: VehicleFit) -> None:
        self.fit = fit
        self.width = float(student.ppf(0.975, max(len(fit.balance.segments) - 1, 3)))

    def of(self, what: Function, logarithm: bool = True) -> Interval:
        """Return value, low and high of a function of the parameters in SI units; of a positive
        quantity as a ratio.
        """
        theta, values = self.fit.theta, self.fit.model.values
        here = float(what(values(theta)))
        steps = 1e-5 * np.eye(len(theta))
        slope = np.array([what(values(theta + e)) - what(values(theta - e)) for e in steps]) / 2e-5
        size = self.width * math.sqrt(max(float(slope @ self.fit.covariance @ slope), 0.0))
        if logarithm and here > 0.0:
            factor = math.exp(min(size / here, 50.0))
            return here, here / factor, here * factor
        return here, here - size, here + size


def thrust_of(values: Values, exponents: Sequence[int], u: float) -> float:
    """Return one rotor's thrust (N) at a speed in rad/s or a command."""
    return sum(values[f"a{j}"] * u**e for j, e in enumerate(exponents))


class Estimates:
    """What is said of one vehicle, and the lengths that the rest scales with.

    Args:
        fit: of the parameters.
        sources: what the logs measure.
        geometry: where the rotors stand.
        kept: the further effects that show, and why one of them is not to be believed.
        hidden: the moment of velocity where it does not show.
        doubt: why nothing is to be believed that torque says; empty where it is.
    """

    def __init__(
        self,
        fit: VehicleFit,
        sources: Sources,
        geometry: Geometry,
        kept: Mapping[str, str],
        hidden: Hidden | None,
        doubt: str,
    ) -> None:
        self.hidden, self.doubt = hidden, doubt
        self.fit, self.sources, self.geometry, self.kept = fit, sources, geometry, kept
        self.intervals = Intervals(fit)
        self.said: list[Estimate] = []
        self.arm = 1.0  # m for each unit of the rotors' positions
        self.arm_range = (1.0, 1.0)  # shares of it
        self.rotors = f"against {sources.rotors}"

    def say_all(
        self, pieces: Sequence[MotionPiece], not_told: Mapping[str, tuple[str, float]]
    ) -> list[Estimate]:
        """Return what is known of every quantity; ``not_told`` are inertias that the flight does
        not show: why, and what is usual instead.
        """
        source = self.sources
        vertical = f"{source.force} along body z against {source.rotors}, with the mass given"
        if self.fit.drive.commands:
            self._say_curve(pieces, vertical)
        else:
            self._say("k", lambda v: v["a0"], "N/(rad/s)^2", vertical)
        self._say_arm()
        self._say_inertia(not_told)
        self._say_yaw()
        self._say_lag()
        self._say_centre()
        self._say_drag()
        return self.said

    def _add(
        self, name: str, known: Interval, unit: str, how: str, status: str = IDENTIFIED
    ) -> None:
        self.said.append(Estimate(name, *known, unit, status, how))

    def _of(self, parameter: str, logarithm: bool = False, times: float = 1.0) -> Interval:
        """Return a parameter's value, low and high, times a factor."""
        return self.intervals.of(lambda v: times * v[parameter], logarithm)

    def _say(self, name: str, of: Function, unit: str, how: str, status: str = IDENTIFIED) -> None:
        """Add a positive quantity, or that its interval is too wide."""
        known = self.intervals.of(of)
        if status == IDENTIFIED and not told(known):
            status, how = NOTHING, f"{how}: the interval is wider than half the value"
        self._add(name, known, unit, how, status)

    def _scaled(self, known: Interval) -> Interval:
        """Return what is a number times the arm, with the range of an arm that is assumed."""
        value, *ends = (self.arm * x for x in known)
        corners = [end * share for end in ends for share in self.arm_range]
        return value, min(corners), max(corners)

    def _say_curve(self, pieces: Sequence[MotionPiece], how: str) -> None:
        exponents = self.fit.drive.exponents
        for j, e in enumerate(exponents):
            self._add(f"thrust u^{e}", self._of(f"a{j}"), "N", how)
        flown = np.concatenate([p.command.ravel() for p in pieces if p.command is not None])
        low, high = np.clip(np.quantile(flown, [0.005, 0.995]), 0.0, 1.0)
        beyond = f"continues the curve beyond the commands flown, {low:.2f} to {high:.2f}"
        for u in (0.25, 0.5, 0.75, 1.0):
            self._say(
                f"thrust({u:g})",
                lambda v, u=u: thrust_of(v, exponents, u),  # type: ignore[misc]
                "N",
                *((how, IDENTIFIED) if low <= u <= high else (beyond, ASSUMED)),
            )

        reference = self.fit.drive.voltage_ref

        def hover(values: Values, share: float = 1.0) -> float:
            weight = self.fit.model.weight * math.pow(share, -values.get("gamma", 0.0))

            def excess(u: float) -> float:
                return 4.0 * thrust_of(values, exponents, u) - weight

            # a curve of few flights may carry the weight at no command, or at none up to 2
            low, high = excess(0.0), excess(2.0)
            return float(brentq(excess, 0.0, 2.0)) if low < 0.0 < high else 2.0 * (low < 0.0)

        self._say("hover command", hover, "1", how)
        if "gamma" not in self.fit.model.free:
            logged = all(p.voltage is not None for p in pieces)
            how = "the voltage hardly changes" if logged else "no voltage is logged"
            how += ": the curve holds for the voltage of these flights"
            self._add("voltage_exponent", UNKNOWN, "1", how, NOTHING)
            return
        known, how = self._of("gamma"), f"{how} and voltage"
        if known[2] - known[1] > USUAL.voltage_exponents:
            how = "command and voltage change together: what the voltage does, the curve may do"
            self._add("voltage_exponent", known, "1", how, NOTHING)
            return
        self._add("voltage_exponent", known, "1", how)
        flown = np.concatenate([p.voltage for p in pieces if p.voltage is not None])
        for volts in np.quantile(flown, [0.05, 0.95]).tolist():
            share = volts / reference
            self._say(f"hover command at {volts:.2f} V", lambda v, s=share: hover(v, s), "1", how)  # type: ignore[misc]

    def _say_arm(self) -> None:
        if self.geometry.known:
            self._add("arm_l", 3 * (self.geometry.arm,), "m", "--geometry", GIVEN)
            return
        # with rotors at unit distance the fit's inertia is inertia over arm, which for a usual
        # radius of gyration is gyration * mass * arm
        values = self.fit.values
        value = 0.5 * (values["Jx"] + values["Jy"]) / self.fit.model.mass / USUAL.gyration
        low, high = (value * USUAL.gyration / g for g in reversed(USUAL.gyration_range))
        how = (
            f"turning shows arm over inertia alone; with {USUAL.gyration:g} mass arm^2 for the "
            f"inertia, {USUAL.gyration_range[0]:g} to {USUAL.gyration_range[1]:g}"
        )
        self._add("arm_l", (value, low, high), "m", how, ASSUMED)
        self.arm, self.arm_range = value, (low / value, high / value)

    def _say_inertia(self, not_told: Mapping[str, tuple[str, float]]) -> None:
        given = (IDENTIFIED, "given") if self.geometry.known else (ASSUMED, "assumed")
        motions = {"Jx": "roll", "Jy": "pitch", "Jz": "yaw while rolling or pitching"}
        for axis, motion in motions.items():
            name = axis + axis[1]
            if axis not in not_told:
                known = self._scaled(self._of(axis, logarithm=True))
                how = f"{self.sources.rate} in {motion} {self.rotors}, with the arm {given[1]}"
                self._add(name, known, "kg m2", how, given[0])
                continue
            reason, usual_value = not_told[axis]
            value = usual_value * self.arm
            if axis == "Jz":
                x, y = self.said[-2:]
                low, high = USUAL.flat_range
                low, high = low * (x.low + y.low), high * (x.high + y.high)
                usual = f"{USUAL.flat:g} of Jxx + Jyy, {USUAL.flat_range[0]:g} to 1"
            else:
                low, high = (value * g / USUAL.gyration for g in USUAL.gyration_range)
                usual = f"{USUAL.gyration:g} mass arm^2"
            self._add(name, (value, low, high), "kg m2", f"{reason}; {usual}", ASSUMED)
        for axis, across in (("Jx", 1), ("Jy", 0)):
            if axis not in not_told:
                length = float(np.mean(np.abs(self.fit.drive.positions[:, across])))
                known = self.intervals.of(lambda v, n=length, axis=axis: n / v[axis])  # type: ignore[misc]
                how = f"{self.sources.rate} {self.rotors}: needs no arm"
                self._add(f"l/{axis}{axis[1]}", known, "1/(kg m)", how)
        if "products of inertia" in self.kept:
            for name in ("Jxy", "Jxz", "Jyz"):
                how = self.doubt or f"{self.sources.rate} across axes"
                status = NOTHING if self.doubt else given[0]
                self._add(name, self._scaled(self._of(name)), "kg m2", how, status)

    def _say_yaw(self) -> None:
        how = f"{self.sources.rate} in yaw {self.rotors}"
        gain = self.intervals.of(lambda v: v["reach"] / v["Jz"])
        inertia = next(e for e in self.said if e.name == "Jzz")
        if self.doubt or not told(gain):
            how = self.doubt or "the flight hardly accelerates in yaw"
            self._add("(p/k)/Jzz", gain, "1/(kg m)", how, NOTHING)
            length = float(np.mean(np.abs(self.fit.drive.positions[:, :2]))) * self.arm
            low, high = (r * length for r in USUAL.reach_range)
            ratio, status = (USUAL.reach * length, low, high), ASSUMED
            how = f"{how}; {USUAL.reach:g} of the arm"
        else:
            self._add("(p/k)/Jzz", gain, "1/(kg m)", how)
            ratio, status = self._scaled(self._of("reach", logarithm=True)), IDENTIFIED
            if inertia.status == ASSUMED:
                # the inertia about z is not told by the flight: the ratio is, and carries it
                values = (inertia.value, inertia.low, inertia.high)
                a, b, c = (x * y for x, y in zip(gain, values, strict=True))
                ratio, status, how = (a, b, c), ASSUMED, f"{how}, with the Jzz that is assumed"
        self._add("p/k", ratio, "m", how, status)
        if not self.fit.drive.commands:
            k = self.said[0].value
            known = (ratio[0] * k, ratio[1] * k, ratio[2] * k)
            if status == IDENTIFIED:
                known = self.intervals.of(lambda v: v["reach"] * v["a0"])
            self._add("p", known, "Nm/(rad/s)^2", how, status)

    def _say_lag(self) -> None:
        name = effect_of(Role.LAG)
        if "lag" in self.fit.model.free:
            how = f"force and turning {self.rotors}"
            if not self.fit.drive.commands:
                how += ", which therefore are commanded, not measured"
            known, status = self._of("lag", logarithm=True), IDENTIFIED
            if not told(known):
                status, how = NOTHING, "a time offset of the motion does nearly the same here"
        else:
            known, status = UNKNOWN, NOTHING
            how = (
                "force follows the logged rotor speeds at once: they are measured, and no command "
                "is logged beside them"
            )
        self._add(name, known, "s", how, status)
        self._add("time_offset", self._of("delay"), "s", "of the motion behind the rotors")

    def _say_centre(self) -> None:
        how = (
            "constant share of thrust in roll and pitch torque: a centre of mass off the rotors' "
            "middle, or unequal rotors"
        )
        for axis in "xy":
            known = self._of(f"c{axis}", times=self.arm)
            status, reason = IDENTIFIED if self.geometry.known else ASSUMED, how
            if known[2] - known[1] > 0.5 * self.arm * self.geometry.arm:
                status = NOTHING
                reason = "thrust hardly changes: a constant torque does the same"
            if self.doubt:
                status, reason = NOTHING, self.doubt
            self._add(f"com {axis}", known, "m", reason, status)
        if self.sources.force == "pose":
            known = self._of("rz", times=-1.0)
            wide = known[2] - known[1] > 0.5 * self.arm * self.geometry.arm
            how = "the pose's point swings about it: or the markers' middle is off"
            self._add("com z", known, "m", how, NOTHING if wide else IDENTIFIED)

    def _say_drag(self) -> None:
        if not self.sources.velocity:
            how = "no velocity is known: the logs have no position"
            self._add("drag", UNKNOWN, "N/(m/s)", how, NOTHING)
            return
        along = f"{self.sources.force} along body x and y against velocity"
        damped = f"{self.sources.rate}, its own derivative against it and against velocity"
        for kind, (role, first, channel) in AIR.items():
            how = {"": along, "z": "force along body z", "turning": damped}[channel]
            doubt = self.kept.get(kind, "") or (self.doubt if channel == "turning" else "")
            for index, parameter in enumerate(OPTIONAL[kind] if kind in self.kept else (), first):
                factor = {"lift": 0.25}.get(kind, self.arm if channel == "turning" else 1.0)
                known = self._of(parameter, channel == "turning", factor)
                unit = get(effect_of(role)).coefficients[index].unit
                status = NOTHING if doubt else IDENTIFIED
                self._add(estimate_name(role, index), known, unit, doubt or how, status)
        if self.hidden:
            role, first, _ = AIR["flapping"]
            value, wide, least = (
                self.arm * x for x in (self.hidden.value, self.hidden.deviation, self.hidden.least)
            )
            wide *= self.intervals.width
            unit = get(effect_of(role)).coefficients[first].unit
            how = self.doubt or (
                f"moments that nothing measures hide it: it would show from {least:.2g} on. Fly "
                "faster to and fro, and longer"
            )
            known = value, value - wide, value + wide
            self._add(estimate_name(role, first), known, unit, how, NOTHING)
        if not {"rotor drag", "linear drag", "quadratic drag"} & set(self.kept):
            known = (0.0, math.nan, math.nan)
            self._add("drag", known, "N/(m/s)", "none stands out of the disturbances", NOTHING)
