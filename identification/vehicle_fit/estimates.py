"""From fitted parameters to a vehicle's estimates: values with intervals, and assumptions in place
of quantities missing from the flight.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.optimize import brentq

from ...dynamics.effects import Role
from ...runtime.errors import InputError
from ..logs.table import Values
from .effect_settings import effect_of, estimate_name
from .geometry import FLAT, GYRATION, VOLTAGE_EXPONENTS, YAW_REACH, Interval
from .parameters import FURTHER
from .result import ASSUMED, GIVEN, IDENTIFIED, NOTHING, Estimate, Estimated, told
from .solve import Function, VehicleFit

UNKNOWN: Interval = (math.nan, math.nan, math.nan)


def thrust_of(values: Values, exponents: Sequence[int], u: float) -> float:
    """Return one rotor's thrust (N) at a speed in rad/s or a command."""
    return sum(values[f"a{j}"] * u**e for j, e in enumerate(exponents))


def _times(known: Interval, by: Interval | float) -> Interval:
    """Return the product of an interval and another, or a number."""
    value, *ends = by if isinstance(by, tuple) else (by, by)
    corners = [x * end for x in known[1:] for end in ends]
    return known[0] * value, min(corners), max(corners)


@dataclass(eq=False)
class Estimates:
    """The estimates of one vehicle, and the length of their scale."""

    fit: VehicleFit
    kept: Mapping[str, str]  # visible further effects, each with the reason to doubt it, or empty
    hidden: Interval | None  # an invisible moment of velocity: value, deviation, least visible
    doubt: str  # reason to believe no estimate of torque; empty without one
    said: Estimated = field(default_factory=dict)
    arm: Interval = (1.0, 1.0, 1.0)  # m for each unit of the rotors' positions

    def say_all(self) -> Estimated:
        """Return the estimate of every quantity.

        Raises:
            InputError: neither turning nor an arm says how large the vehicle is.
        """
        of = self.fit.model.sources
        vertical = f"{of.force} along body z against {of.rotors}, with the mass given"
        if self.fit.model.commands:
            self._say_curve(vertical)
        else:
            self._say_positive("k", "a0", "N/(rad/s)^2", vertical)
        self._say_arm_and_inertia(of.rate, f"against {of.rotors}")
        self._say_yaw(f"{of.rate} in yaw against {of.rotors}")
        self._say_lag(f"force and turning against {of.rotors}")
        self._say_centre()
        self._say_air()
        return self.said

    def _say(
        self,
        name: str,
        known: Interval,
        unit: str,
        how: str,
        doubt: str = "",
        status: str = IDENTIFIED,
    ) -> None:
        status, how = (NOTHING, doubt) if doubt else (status, how)
        self.said[name] = Estimate(name, *known, unit, status, how)

    def _say_positive(self, name: str, what: str | Function, unit: str, how: str) -> None:
        known = self.fit.interval(what)
        wide = f"{how}: the interval is wider than half the value"
        self._say(name, known, unit, how, "" if told(known) else wide)

    def _say_curve(self, how: str) -> None:
        fit, exponents, pieces = self.fit, self.fit.model.exponents, self.fit.balance.pieces
        for j, e in enumerate(exponents):
            self._say(f"thrust u^{e}", fit.interval(f"a{j}", False), "N", how)
        flown = np.concatenate([p.rotors for p in pieces])
        low, high = np.clip(np.quantile(flown, [0.005, 0.995]), 0.0, 1.0)
        beyond = f"continues the curve beyond the commands flown, {low:.2f} to {high:.2f}"
        for u in (0.25, 0.5, 0.75, 1.0):
            name, thrust = f"thrust({u:g})", partial(thrust_of, exponents=exponents, u=u)
            if low <= u <= high:
                self._say_positive(name, thrust, "N", how)
            else:
                self._say(name, fit.interval(thrust), "N", beyond, status=ASSUMED)

        def hover(values: Values, share: float = 1.0) -> float:
            weight = fit.model.weight * math.pow(share, -values.get("gamma", 0.0))

            def excess(u: float) -> float:
                return 4.0 * thrust_of(values, exponents, u) - weight

            # a curve of few flights may carry the weight at no command, or at none up to 2
            low, high = excess(0.0), excess(2.0)
            return float(brentq(excess, 0.0, 2.0)) if low < 0.0 < high else 2.0 * (low < 0.0)

        self._say_positive("hover command", hover, "1", how)
        voltages = [p.voltage for p in pieces if p.voltage is not None]
        if "gamma" in fit.model.free:
            known, how = fit.interval("gamma", False), f"{how} and voltage"
            together = "command and voltage change together: what the voltage does, the curve may do"
            why = together * (known[2] - known[1] > VOLTAGE_EXPONENTS)
        else:
            logged = len(voltages) == len(pieces)
            known, why = UNKNOWN, "the voltage hardly changes" if logged else "no voltage is logged"
            why += ": the curve holds for the voltage of these flights"
        self._say("voltage_exponent", known, "1", how, why)
        if not why:
            for volts in np.quantile(np.concatenate(voltages), [0.05, 0.95]).tolist():
                at_voltage = partial(hover, share=volts / fit.model.voltage_ref)
                self._say_positive(f"hover command at {volts:.2f} V", at_voltage, "1", how)

    def _say_arm_and_inertia(self, rate: str, rotors: str) -> None:
        fit, geometry, mass = self.fit, self.fit.model.geometry, self.fit.model.mass
        motions = {"Jx": "roll", "Jy": "pitch", "Jz": "yaw while rolling or pitching"}
        known = {axis: fit.interval(axis) for axis in motions}
        flat = known["Jz"][0] / (known["Jx"][0] + known["Jy"][0])
        why = {
            axis: self.doubt or f"the flight hardly shows {motion}"
            for axis, motion in motions.items()
            if self.doubt or not told(known[axis]) or (axis == "Jz" and not 0.3 < flat < 1.3)
        }
        status, given, how = IDENTIFIED, "given", "--geometry"
        if geometry.known:
            self._say("arm_l", 3 * (geometry.arm,), "m", how, status=GIVEN)
        elif unknown := dict.fromkeys(why[axis] for axis in ("Jx", "Jy") if axis in why):
            raise InputError(
                f"{'; '.join(unknown)}, and no arm is given; expected "
                "--geometry, or a log with quick roll and pitch"
            )
        else:
            # with rotors at unit distance the fit's inertia is inertia over arm: gyration * mass *
            # arm at a usual radius of gyration
            mean = 0.5 * (known["Jx"][0] + known["Jy"][0])
            value, high, low = (mean / mass / g for g in GYRATION)
            how = (
                "turning shows arm over inertia alone; with {:g} mass arm^2 for the inertia, "
                "{:g} to {:g}"
            ).format(*GYRATION)
            self.arm, status, given = (value, low, high), ASSUMED, "assumed"
            self._say("arm_l", self.arm, "m", how, status=ASSUMED)
        for axis, motion in motions.items():
            name = axis + axis[1]
            if axis not in why:
                how = f"{rate} in {motion} {rotors}, with the arm {given}"
                self._say(name, _times(known[axis], self.arm), "kg m2", how, status=status)
                continue
            size, how = _times(GYRATION, mass * geometry.arm**2), f"{GYRATION[0]:g} mass arm^2"
            if axis == "Jz":
                x, y = self.said["Jxx"], self.said["Jyy"]
                size = _times(FLAT, (x.value + y.value, x.low + y.low, x.high + y.high))
                how = "{:g} of Jxx + Jyy, {:g} to 1".format(*FLAT)
            self._say(name, size, "kg m2", f"{why[axis]}; {how}", status=ASSUMED)
        for axis, across in (("Jx", 1), ("Jy", 0)):
            if axis not in why:
                length = np.abs(geometry.positions[:, across]).mean()
                value, high, low = (length / x for x in known[axis])
                how = f"{rate} {rotors}: needs no arm"
                self._say(f"l/{axis}{axis[1]}", (value, low, high), "1/(kg m)", how)
        for name in ("Jxy", "Jxz", "Jyz") if "products of inertia" in self.kept else ():
            doubt = self.doubt or self.kept["products of inertia"]
            product = _times(fit.interval(name, False), self.arm)
            self._say(name, product, "kg m2", f"{rate} across axes", doubt, status)

    def _say_yaw(self, how: str) -> None:
        gain = self.fit.interval(lambda v: v["reach"] / v["Jz"])
        inertia, status, k = self.said["Jzz"], ASSUMED, self.said.get("k")
        doubt = self.doubt or ("" if told(gain) else "the flight hardly accelerates in yaw")
        self._say("(p/k)/Jzz", gain, "1/(kg m)", how, doubt)
        ratio, product = _times(gain, inertia[1:4]), None
        if doubt:
            length = self.fit.model.geometry.arm * self.arm[0]
            ratio, how = _times(YAW_REACH, length), f"{doubt}; {YAW_REACH[0]:g} of the arm"
        elif inertia.status == ASSUMED:
            # the flight tells the gain alone: p/k carries the assumption of Jzz
            how = f"{how}, with the Jzz that is assumed"
        else:
            ratio, status = _times(self.fit.interval("reach"), self.arm), IDENTIFIED
            product = self.fit.interval(lambda v: v["reach"] * v["a0"])
        self._say("p/k", ratio, "m", how, status=status)
        if k is not None:
            self._say("p", product or _times(ratio, k.value), "Nm/(rad/s)^2", how, status=status)

    def _say_lag(self, how: str) -> None:
        known, doubt = UNKNOWN, (
            "force follows the logged rotor speeds at once: they are measured, and no command is "
            "logged beside them"
        )
        if "lag" in self.fit.model.free:
            if not self.fit.model.commands:
                how += ", which therefore are commanded, not measured"
            known = self.fit.interval("lag")
            late = "a time offset of the motion does nearly the same here"
            doubt = "" if told(known) else late
        self._say(effect_of(Role.LAG), known, "s", how, doubt)
        offset = self.fit.interval("delay", False)
        self._say("time_offset", offset, "s", "of the motion behind the rotors")

    def _say_centre(self) -> None:
        model = self.fit.model
        how = (
            "constant share of thrust in roll and pitch torque: a centre of mass off the rotors' "
            "middle, or unequal rotors"
        )
        steady = "thrust hardly changes: a constant torque does the same"
        swing = "the pose's point swings about it: or the markers' middle is off"
        widest = 0.5 * self.arm[0] * model.geometry.arm
        status = IDENTIFIED if model.geometry.known else ASSUMED
        for axis in "xy":
            known = _times(self.fit.interval(f"c{axis}", False), self.arm[0])
            doubt = self.doubt or steady * (known[2] - known[1] > widest)
            self._say(f"com {axis}", known, "m", how, doubt, status)
        if model.sources.force == "pose":
            known = self.fit.interval(lambda v: -v["rz"], False)
            self._say("com z", known, "m", swing, swing * (known[2] - known[1] > widest))

    def _say_air(self) -> None:
        of = self.fit.model.sources
        if not of.velocity:
            why = "no velocity is known: the logs have no position"
            self._say("drag", UNKNOWN, "N/(m/s)", "", why)
            return
        hows = {
            "force": f"{of.force} along body x and y against velocity",
            "thrust": "force along body z",
            "turning": f"{of.rate}, its own derivative against it and against velocity",
        }
        for kind, effect in FURTHER.items():
            if not effect.role or kind not in self.kept:
                continue
            turns = effect.shows == "turning"
            size = effect.factor * (self.arm[0] if turns else 1.0)
            why = (self.doubt if turns else "") or self.kept[kind]
            for index, parameter in enumerate(effect.parameters, effect.first):
                known = _times(self.fit.interval(parameter, turns), size)
                self._say_effect(effect.role, index, known, hows[effect.shows], why)
        if self.hidden:
            value, deviation, least = (self.arm[0] * x for x in self.hidden)
            wide = self.fit.width * deviation
            why = self.doubt or (
                f"moments that nothing measures hide it: it would show from {least:.2g} on. Fly "
                "faster to and fro, and longer"
            )
            known = value, value - wide, value + wide
            self._say_effect(Role.FLAPPING_MOMENT, 0, known, "", why)
        if not {"rotor drag", "linear drag", "quadratic drag"} & set(self.kept):
            why = "none stands out of the disturbances"
            self._say("drag", (0.0, math.nan, math.nan), "N/(m/s)", "", why)

    def _say_effect(self, role: str, index: int, known: Interval, how: str, doubt: str) -> None:
        self._say(estimate_name(role, index), known, Role(role).units[index], how, doubt)
