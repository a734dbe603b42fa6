"""From fitted parameters to a vehicle's estimates: values with intervals, and assumptions in place
of quantities missing from the flight.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.optimize import brentq

from ...dynamics.effects import Role, get
from ...runtime.errors import InputError
from ..logs.table import Pair, Values
from .channels import Pieces
from .effect_settings import effect_of, estimate_name
from .geometry import FLAT, GYRATION, VOLTAGE_EXPONENTS, YAW_REACH, Interval
from .parameters import FURTHER
from .result import ASSUMED, GIVEN, IDENTIFIED, NOTHING, Estimate, Estimated, told
from .solve import Function, VehicleFit

UNKNOWN: Interval = (math.nan, math.nan, math.nan)


def thrust_of(values: Values, exponents: Sequence[int], u: float) -> float:
    """Return one rotor's thrust (N) at a speed in rad/s or a command."""
    return sum(values[f"a{j}"] * u**e for j, e in enumerate(exponents))


def _times(size: float, known: Interval) -> Interval:
    value, low, high = (size * x for x in known)
    return value, low, high


@dataclass(eq=False)
class Estimates:
    """The estimates of one vehicle, and the lengths of their scale."""

    fit: VehicleFit
    kept: Mapping[str, str]  # visible further effects, each with the reason to doubt it, or empty
    hidden: Interval | None  # an invisible moment of velocity: value, deviation, least visible
    doubt: str  # reason to believe no estimate of torque; empty without one
    said: Estimated = field(default_factory=dict)
    arm: float = 1.0  # m for each unit of the rotors' positions
    arm_range: Pair = (1.0, 1.0)  # shares of it

    def say_all(self, pieces: Pieces) -> Estimated:
        """Return the estimate of every quantity.

        Raises:
            InputError: neither turning nor an arm says how large the vehicle is.
        """
        of = self.fit.model.sources
        vertical = f"{of.force} along body z against {of.rotors}, with the mass given"
        if self.fit.model.commands:
            self._say_curve(pieces, vertical)
        else:
            self._say_positive("k", "a0", "N/(rad/s)^2", vertical)
        self._say_arm_and_inertia()
        self._say_yaw()
        self._say_lag()
        self._say_centre()
        self._say_air()
        return self.said

    def _say(
        self,
        name: str,
        known: Interval,
        unit: str,
        how: str,
        status: str = IDENTIFIED,
        doubt: str = "",
    ) -> None:
        status, how = (NOTHING, doubt) if doubt else (status, how)
        self.said[name] = Estimate(name, *known, unit, status, how)

    def _say_positive(
        self, name: str, what: str | Function, unit: str, how: str, status: str = IDENTIFIED
    ) -> None:
        known = self.fit.interval(what)
        wide = f"{how}: the interval is wider than half the value"
        doubt = wide if status == IDENTIFIED and not told(known) else ""
        self._say(name, known, unit, how, status, doubt)

    def _scaled(self, known: Interval) -> Interval:
        """Return a multiple of the arm, with the range of an assumed arm."""
        value, *ends = _times(self.arm, known)
        corners = [end * share for end in ends for share in self.arm_range]
        return value, min(corners), max(corners)

    def _say_curve(self, pieces: Pieces, how: str) -> None:
        fit, exponents = self.fit, self.fit.model.exponents
        for j, e in enumerate(exponents):
            self._say(f"thrust u^{e}", fit.interval(f"a{j}", False), "N", how)
        flown = np.concatenate([p.rotors for p in pieces])
        low, high = np.clip(np.quantile(flown, [0.005, 0.995]), 0.0, 1.0)
        beyond = f"continues the curve beyond the commands flown, {low:.2f} to {high:.2f}"
        for u in (0.25, 0.5, 0.75, 1.0):
            self._say_positive(
                f"thrust({u:g})",
                partial(thrust_of, exponents=exponents, u=u),
                "N",
                *((how, IDENTIFIED) if low <= u <= high else (beyond, ASSUMED)),
            )

        def hover(values: Values, share: float = 1.0) -> float:
            weight = fit.model.weight * math.pow(share, -values.get("gamma", 0.0))

            def excess(u: float) -> float:
                return 4.0 * thrust_of(values, exponents, u) - weight

            # a curve of few flights may carry the weight at no command, or at none up to 2
            low, high = excess(0.0), excess(2.0)
            return float(brentq(excess, 0.0, 2.0)) if low < 0.0 < high else 2.0 * (low < 0.0)

        self._say_positive("hover command", hover, "1", how)
        if "gamma" not in fit.model.free:
            logged = all(p.voltage is not None for p in pieces)
            why = "the voltage hardly changes" if logged else "no voltage is logged"
            why += ": the curve holds for the voltage of these flights"
            self._say("voltage_exponent", UNKNOWN, "1", how, doubt=why)
            return
        known, how = fit.interval("gamma", False), f"{how} and voltage"
        why = "command and voltage change together: what the voltage does, the curve may do"
        wide = known[2] - known[1] > VOLTAGE_EXPONENTS
        self._say("voltage_exponent", known, "1", how, doubt=why if wide else "")
        flown = np.concatenate([p.voltage for p in pieces if p.voltage is not None])
        for volts in () if wide else np.quantile(flown, [0.05, 0.95]).tolist():
            at_voltage = partial(hover, share=volts / fit.model.voltage_ref)
            self._say_positive(f"hover command at {volts:.2f} V", at_voltage, "1", how)

    def _say_arm_and_inertia(self) -> None:
        fit, values = self.fit, self.fit.values
        known_arm, mass = self.fit.model.geometry.known, self.fit.model.mass
        flat = values["Jz"] / (values["Jx"] + values["Jy"])
        motions = {"Jx": "roll", "Jy": "pitch", "Jz": "yaw while rolling or pitching"}
        why = {
            axis: self.doubt or f"the flight hardly shows {motion}"
            for axis, motion in motions.items()
            if self.doubt or not told(fit.interval(axis)) or (axis == "Jz" and not 0.3 < flat < 1.3)
        }
        unknown = dict.fromkeys(why[axis] for axis in ("Jx", "Jy") if axis in why)
        if unknown and not known_arm:
            raise InputError(
                f"{'; '.join(unknown)}, and no arm is given; expected "
                "--geometry, or a log with quick roll and pitch"
            )
        if known_arm:
            self._say("arm_l", 3 * (self.fit.model.geometry.arm,), "m", "--geometry", GIVEN)
        else:
            # with rotors at unit distance the fit's inertia is inertia over arm: gyration * mass *
            # arm at a usual radius of gyration
            mean = 0.5 * (values["Jx"] + values["Jy"])
            value, high, low = (mean / mass / g for g in GYRATION)
            how = (
                "turning shows arm over inertia alone; with {:g} mass arm^2 for the inertia, "
                "{:g} to {:g}"
            ).format(*GYRATION)
            self._say("arm_l", (value, low, high), "m", how, ASSUMED)
            self.arm, self.arm_range = value, (low / value, high / value)
        status, given = (IDENTIFIED, "given") if known_arm else (ASSUMED, "assumed")
        rate, rotors = self.fit.model.sources.rate, f"against {self.fit.model.sources.rotors}"
        for axis, motion in motions.items():
            name = axis + axis[1]
            if axis not in why:
                how = f"{rate} in {motion} {rotors}, with the arm {given}"
                self._say(name, self._scaled(fit.interval(axis)), "kg m2", how, status)
                continue
            if axis == "Jz":
                x, y = self.said["Jxx"], self.said["Jyy"]
                flat, low, high = FLAT
                known = flat * (x.value + y.value), low * (x.low + y.low), high * (x.high + y.high)
                how = f"{flat:g} of Jxx + Jyy, {low:g} to 1"
            else:
                known = _times(mass * self.fit.model.geometry.arm**2, GYRATION)
                how = f"{GYRATION[0]:g} mass arm^2"
            self._say(name, known, "kg m2", f"{why[axis]}; {how}", ASSUMED)
        for axis, across in (("Jx", 1), ("Jy", 0)):
            if axis not in why:
                length = np.abs(fit.model.geometry.positions[:, across]).mean()
                value, low, high = (length / x for x in fit.interval(axis))
                how = f"{rate} {rotors}: needs no arm"
                self._say(f"l/{axis}{axis[1]}", (value, high, low), "1/(kg m)", how)
        for name in ("Jxy", "Jxz", "Jyz") if "products of inertia" in self.kept else ():
            doubt = self.doubt or self.kept["products of inertia"]
            known = self._scaled(fit.interval(name, False))
            self._say(name, known, "kg m2", f"{rate} across axes", status, doubt)

    def _say_yaw(self) -> None:
        how = f"{self.fit.model.sources.rate} in yaw against {self.fit.model.sources.rotors}"
        gain = self.fit.interval(lambda v: v["reach"] / v["Jz"])
        inertia, status = self.said["Jzz"], ASSUMED
        doubt = self.doubt or ("" if told(gain) else "the flight hardly accelerates in yaw")
        self._say("(p/k)/Jzz", gain, "1/(kg m)", how, doubt=doubt)
        if doubt:
            length = self.fit.model.geometry.arm * self.arm
            ratio, how = _times(length, YAW_REACH), f"{doubt}; {YAW_REACH[0]:g} of the arm"
        elif inertia.status == ASSUMED:
            # the flight tells the ratio alone: p/k carries the assumption of Jzz
            ratio = gain[0] * inertia.value, gain[1] * inertia.low, gain[2] * inertia.high
            how = f"{how}, with the Jzz that is assumed"
        else:
            ratio, status = self._scaled(self.fit.interval("reach")), IDENTIFIED
        self._say("p/k", ratio, "m", how, status)
        if not self.fit.model.commands:
            known = _times(self.said["k"].value, ratio)
            if status == IDENTIFIED:
                known = self.fit.interval(lambda v: v["reach"] * v["a0"])
            self._say("p", known, "Nm/(rad/s)^2", how, status)

    def _say_lag(self) -> None:
        known = UNKNOWN
        doubt = (
            "force follows the logged rotor speeds at once: they are measured, and no command is "
            "logged beside them"
        )
        how = f"force and turning against {self.fit.model.sources.rotors}"
        if "lag" in self.fit.model.free:
            if not self.fit.model.commands:
                how += ", which therefore are commanded, not measured"
            known = self.fit.interval("lag")
            late = "a time offset of the motion does nearly the same here"
            doubt = "" if told(known) else late
        self._say(effect_of(Role.LAG), known, "s", how, doubt=doubt)
        offset = self.fit.interval("delay", False)
        self._say("time_offset", offset, "s", "of the motion behind the rotors")

    def _say_centre(self) -> None:
        how = (
            "constant share of thrust in roll and pitch torque: a centre of mass off the rotors' "
            "middle, or unequal rotors"
        )
        steady = "thrust hardly changes: a constant torque does the same"
        swing = "the pose's point swings about it: or the markers' middle is off"
        widest = 0.5 * self.arm * self.fit.model.geometry.arm
        for axis in "xy":
            known = _times(self.arm, self.fit.interval(f"c{axis}", False))
            doubt = self.doubt or steady * (known[2] - known[1] > widest)
            status = IDENTIFIED if self.fit.model.geometry.known else ASSUMED
            self._say(f"com {axis}", known, "m", how, status, doubt)
        if self.fit.model.sources.force == "pose":
            known = self.fit.interval(lambda v: -v["rz"], False)
            self._say("com z", known, "m", swing, doubt=swing * (known[2] - known[1] > widest))

    def _say_air(self) -> None:
        if not self.fit.model.sources.velocity:
            why = "no velocity is known: the logs have no position"
            self._say("drag", UNKNOWN, "N/(m/s)", "", doubt=why)
            return
        along = f"{self.fit.model.sources.force} along body x and y against velocity"
        damped = f"{self.fit.model.sources.rate}, its own derivative against it and against velocity"
        for kind, effect in FURTHER.items():
            if effect.role is None or kind not in self.kept:
                continue
            turns = effect.shows == "turning"
            how = {"": along, "z": "force along body z", "turning": damped}[effect.shows]
            factor = {"lift": 0.25}.get(kind, self.arm if turns else 1.0)
            why = (self.doubt if turns else "") or self.kept[kind]
            for index, parameter in enumerate(effect.parameters, effect.first):
                known = _times(factor, self.fit.interval(parameter, turns))
                unit = get(effect_of(effect.role)).coefficients[index].unit
                self._say(estimate_name(effect.role, index), known, unit, how, doubt=why)
        if self.hidden:
            role = Role.FLAPPING_MOMENT
            value, deviation, least = (self.arm * x for x in self.hidden)
            wide = self.fit.width * deviation
            why = self.doubt or (
                f"moments that nothing measures hide it: it would show from {least:.2g} on. Fly "
                "faster to and fro, and longer"
            )
            unit = get(effect_of(role)).coefficients[0].unit
            known = value, value - wide, value + wide
            self._say(estimate_name(role, 0), known, unit, damped, doubt=why)
        if not {"rotor drag", "linear drag", "quadratic drag"} & set(self.kept):
            why = "none stands out of the disturbances"
            self._say("drag", (0.0, math.nan, math.nan), "N/(m/s)", "", doubt=why)
