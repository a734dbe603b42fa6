"""From fitted parameters to what is said of a vehicle: values with intervals, and what is assumed
where the flight does not tell.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ...dynamics.effects import Role, get
from .channels import Piece, Sources
from .effect_settings import effect_of, estimate_name
from .geometry import Geometry
from .result import ASSUMED, GIVEN, IDENTIFIED, NOTHING, Estimate, told
from .solve import Fit
from .spectra import SPECTRUM
from .usual import USUAL

Array = NDArray[np.float64]
Values = Mapping[str, float]
Function = Callable[[Values], float]


class Reading:
    """Values and 95 % intervals of a fit's parameters, and of what follows from them."""

    def __init__(self, fit: Fit) -> None:
        self.fit = fit
        count = len(fit.balance.segments)
        self.width = float(student.ppf(0.975, max(count - 1, 3)))
        n = len(fit.model.free)
        self._theta = np.concatenate(
            [fit.theta[:n], [getattr(fit.drive, name) for name in fit.names[n:]]]
        )
        self._covariance = fit.covariance

    def interval(self, what: Function, logarithm: bool = True) -> tuple[float, float, float]:
        """Return value, low and high of a function of the parameters in SI units; of a positive
        quantity as a ratio.
        """
        here = float(what(self._at(0, 0.0)))
        slope = np.empty(len(self._theta))
        for i in range(len(slope)):
            slope[i] = (what(self._at(i, 1e-5)) - what(self._at(i, -1e-5))) / 2e-5
        size = self.width * math.sqrt(max(float(slope @ self._covariance @ slope), 0.0))
        if logarithm and here > 0.0:
            factor = math.exp(min(size / here, 50.0))
            return here, here / factor, here * factor
        return here, here - size, here + size

    def _at(self, i: int, step: float) -> dict[str, float]:
        theta = self._theta.copy()
        theta[i] += step
        n = len(self.fit.model.free)
        named = zip(self.fit.names[n:], theta[n:], strict=True)
        return {**self.fit.model.values(theta[:n]), **{name: float(x) for name, x in named}}


def _value(name: str, factor: float = 1.0) -> Function:
    return lambda v: factor * v[name]


def _over(value: float, name: str) -> Function:
    return lambda v: value / v[name]


def thrust_of(values: Values, exponents: Sequence[int], u: float) -> float:
    """Return one rotor's thrust (N) at a speed in rad/s or a command."""
    return sum(values[f"a{j}"] * u**e for j, e in enumerate(exponents))


def estimates_of(
    fit: Fit,
    sources: Sources,
    geometry: Geometry,
    pieces: Sequence[Piece],
    not_told: tuple[Mapping[str, str], Mapping[str, float]],
    kept: Sequence[str],
    weight: float,
) -> list[Estimate]:
    """Return what is known of every quantity.

    Args:
        fit: of the parameters.
        sources: what the logs measure.
        geometry: where the rotors stand.
        pieces: of the logs.
        not_told: inertias that the flight does not show: why, and what is usual instead.
        kept: names of the further effects that show.
        weight: N.
    """
    read = Reading(fit)
    out: list[Estimate] = []

    def say(
        name: str, of: Function, unit: str, how: str, status: str = IDENTIFIED, log: bool = True
    ) -> None:
        known = read.interval(of, log)
        if log and status == IDENTIFIED and not told(known):
            status, how = NOTHING, f"{how}: the interval is wider than half the value"
        out.append(Estimate(name, *known, unit, status, how))

    vertical = f"{sources.force} along body z against {sources.rotors}, with the mass given"
    if fit.drive.commands:
        _curve(say, fit, pieces, weight, vertical)
    else:
        say("k", lambda v: v["a0"], "N/(rad/s)^2", vertical)
    arm, arm_range = _arm(out, read, geometry)
    _inertia(out, read, sources, arm, arm_range, not_told, kept)
    _yaw(out, read, sources, arm, arm_range)
    _lag(out, read, sources)
    _centre(out, read, sources, geometry, arm)
    _drag(out, read, sources, arm, kept)
    return out


def _curve(
    say: Callable[..., None], fit: Fit, pieces: Sequence[Piece], weight: float, how: str
) -> None:
    exponents = fit.drive.exponents
    for j, e in enumerate(exponents):
        say(f"thrust u^{e}", lambda v, j=j: v[f"a{j}"], "N", how, IDENTIFIED, False)
    flown = np.concatenate([p.command.ravel() for p in pieces if p.command is not None])
    low, high = np.clip(np.quantile(flown, [0.005, 0.995]), 0.0, 1.0)
    for u in (0.25, 0.5, 0.75, 1.0):
        inside = low <= u <= high
        say(
            f"thrust({u:g})",
            lambda v, u=u: thrust_of(v, exponents, u),
            "N",
            how
            if inside
            else f"continues the curve beyond the commands flown, {low:.2f} to {high:.2f}",
            IDENTIFIED if inside else ASSUMED,
        )
    say("hover command", lambda v: _hover(v, exponents, weight), "1", how)
    if "gamma" in fit.names:
        say("voltage_exponent", lambda v: v["gamma"], "1", how + " and voltage", log=False)


def _hover(values: Values, exponents: Sequence[int], weight: float) -> float:
    low, high = 0.0, 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if 4.0 * thrust_of(values, exponents, middle) < weight:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _arm(
    out: list[Estimate], read: Reading, geometry: Geometry
) -> tuple[float, tuple[float, float]]:
    """Return the arm's length and its range as shares of it, and say it."""
    if geometry.known:
        out.append(
            Estimate("arm_l", geometry.arm, geometry.arm, geometry.arm, "m", GIVEN, "--geometry")
        )
        return 1.0, (1.0, 1.0)
    # with rotors at unit distance the fit's inertia is inertia over arm, which for a usual radius
    # of gyration is gyration * mass * arm
    mass = read.fit.model.mass

    def ratio(v: Values) -> float:
        return 0.5 * (v["Jx"] + v["Jy"]) / mass

    value = ratio(read.fit.values) / USUAL.gyration
    low, high = (value * USUAL.gyration / g for g in reversed(USUAL.gyration_range))
    out.append(
        Estimate(
            "arm_l",
            value,
            low,
            high,
            "m",
            ASSUMED,
            f"turning shows arm over inertia alone; with {USUAL.gyration:g} mass arm^2 for the "
            f"inertia, {USUAL.gyration_range[0]:g} to {USUAL.gyration_range[1]:g}",
        )
    )
    return value, (low / value, high / value)


def _times(
    known: tuple[float, float, float], factor: float, share: tuple[float, float]
) -> tuple[float, float, float]:
    value, low, high = (factor * x for x in known)
    a, b = (low, high) if low <= high else (high, low)
    corners = [a * share[0], a * share[1], b * share[0], b * share[1]]
    return value, min(corners), max(corners)


def _inertia(
    out: list[Estimate],
    read: Reading,
    sources: Sources,
    arm: float,
    arm_range: tuple[float, float],
    not_told: tuple[Mapping[str, str], Mapping[str, float]],
    kept: Sequence[str],
) -> None:
    fixed, instead = not_told
    scaled = arm_range != (1.0, 1.0)
    for name, axis in (("Jxx", "Jx"), ("Jyy", "Jy"), ("Jzz", "Jz")):
        if axis in fixed:
            value = instead[axis] * arm
            if axis == "Jz":
                both = out[-1], out[-2]
                low, high = (
                    share * sum(e.low if i == 0 else e.high for e in both)
                    for i, share in enumerate(USUAL.flat_range)
                )
                how = f"{fixed[axis]}; {USUAL.flat:g} of Jxx + Jyy, {USUAL.flat_range[0]:g} to 1"
            else:
                low, high = (value * g / USUAL.gyration for g in USUAL.gyration_range)
                how = f"{fixed[axis]}; {USUAL.gyration:g} mass arm^2"
            out.append(Estimate(name, value, low, high, "kg m2", ASSUMED, how))
            continue
        known = read.interval(_value(axis))
        motion = {"Jx": "roll", "Jy": "pitch", "Jz": "yaw while rolling or pitching"}[axis]
        how = f"{sources.rate} in {motion} against {sources.rotors}, with the arm"
        out.append(
            Estimate(
                name,
                *_times(known, arm, arm_range),
                "kg m2",
                ASSUMED if scaled else IDENTIFIED,
                how + (" assumed" if scaled else " given"),
            )
        )
    for name, axis in (("l/Jxx", "Jx"), ("l/Jyy", "Jy")):
        if axis not in fixed:
            length = read.fit.drive.positions
            own = float(np.mean(np.abs(length[:, 1 if axis == "Jx" else 0])))
            known = read.interval(_over(own, axis))
            how = f"{sources.rate} against {sources.rotors}: needs no arm"
            out.append(Estimate(name, *known, "1/(kg m)", IDENTIFIED, how))
    if "products of inertia" in kept:
        for name in ("Jxy", "Jxz", "Jyz"):
            known = read.interval(_value(name), False)
            status = ASSUMED if scaled else IDENTIFIED
            out.append(
                Estimate(
                    name,
                    *_times(known, arm, arm_range),
                    "kg m2",
                    status,
                    f"{sources.rate} across axes",
                )
            )


def _yaw(
    out: list[Estimate],
    read: Reading,
    sources: Sources,
    arm: float,
    arm_range: tuple[float, float],
) -> None:
    commands = read.fit.drive.commands
    how = f"{sources.rate} in yaw against {sources.rotors}"
    gain = read.interval(lambda v: v["reach"] / v["Jz"])
    name = "(p/k)/Jzz"
    doubtful = read.fit.drive.band < SPECTRUM.band
    if doubtful or not told(gain):
        reason = (
            "quick motion contradicts slow motion in these logs"
            if doubtful
            else "the flight hardly accelerates in yaw"
        )
        out.append(Estimate(name, *gain, "1/(kg m)", NOTHING, reason))
        length = float(np.mean(np.abs(read.fit.drive.positions[:, :2]))) * arm
        low, high = (r * length for r in USUAL.reach_range)
        value = USUAL.reach * length
        out.append(
            Estimate("p/k", value, low, high, "m", ASSUMED, f"{reason}; {USUAL.reach:g} of the arm")
        )
    else:
        out.append(Estimate(name, *gain, "1/(kg m)", IDENTIFIED, how))
        known = read.interval(lambda v: v["reach"])
        inertia = next(e for e in out if e.name == "Jzz")
        if inertia.status == ASSUMED:
            # the inertia about z is not told by the flight: the ratio is, and carries it
            reach = gain[0] * inertia.value
            low, high = gain[1] * inertia.low, gain[2] * inertia.high
            out.append(
                Estimate(
                    "p/k", reach, low, high, "m", ASSUMED, f"{how}, with the Jzz that is assumed"
                )
            )
        else:
            out.append(Estimate("p/k", *_times(known, arm, arm_range), "m", IDENTIFIED, how))
    if not commands:
        ratio, k = out[-1], out[0]
        if ratio.status == IDENTIFIED:
            known = read.interval(lambda v: v["reach"] * v["a0"])
        else:
            known = (ratio.value * k.value, ratio.low * k.value, ratio.high * k.value)
        out.append(Estimate("p", *known, "Nm/(rad/s)^2", ratio.status, ratio.how))


def _lag(out: list[Estimate], read: Reading, sources: Sources) -> None:
    name = effect_of(Role.LAG)
    if "lag" in read.fit.names:
        how = f"force and turning against {sources.rotors}" + (
            "" if read.fit.drive.commands else ", which therefore are commanded, not measured"
        )
        known = read.interval(lambda v: v["lag"])
        status = IDENTIFIED
        if not told(known):
            status, how = NOTHING, "a time offset of the motion does nearly the same here"
        out.append(Estimate(name, *known, "s", status, how))
    else:
        out.append(
            Estimate(
                name,
                math.nan,
                math.nan,
                math.nan,
                "s",
                NOTHING,
                "force follows the logged rotor speeds at once: they are measured, and no command "
                "is logged beside them",
            )
        )
    known = read.interval(lambda v: v["delay"], False)
    out.append(Estimate("time_offset", *known, "s", IDENTIFIED, "of the motion behind the rotors"))


def _centre(
    out: list[Estimate], read: Reading, sources: Sources, geometry: Geometry, arm: float
) -> None:
    how = (
        "constant share of thrust in roll and pitch torque: a centre of mass off the rotors' "
        "middle, or unequal rotors"
    )
    for name in ("cx", "cy"):
        known = read.interval(_value(name), False)
        wide = known[2] - known[0] > 0.5 * geometry.arm
        status = NOTHING if wide else IDENTIFIED if geometry.known else ASSUMED
        reason = "thrust hardly changes: a constant torque does the same" if wide else how
        value, low, high = (arm * x for x in known)
        out.append(Estimate(f"com {name[1]}", value, low, high, "m", status, reason))
    if sources.force == "pose":
        known = read.interval(lambda v: -v["rz"], False)
        wide = known[2] - known[0] > 0.5 * arm * geometry.arm
        out.append(
            Estimate(
                "com z",
                *known,
                "m",
                NOTHING if wide else IDENTIFIED,
                "the pose's point swings about it: or the markers' middle is off",
            )
        )


def _drag(
    out: list[Estimate], read: Reading, sources: Sources, arm: float, kept: Sequence[str]
) -> None:
    if not sources.velocity:
        out.append(
            Estimate(
                "drag",
                math.nan,
                math.nan,
                math.nan,
                "N/(m/s)",
                NOTHING,
                "no velocity is known: the logs have no position",
            )
        )
        return
    how = f"{sources.force} along body x and y against velocity"
    # the role that holds it, and where its coefficient along x is
    kinds = {
        "rotor drag": (Role.ROTOR_DRAG, 0),
        "linear drag": (Role.BODY_DRAG, 0),
        "quadratic drag": (Role.BODY_DRAG, 3),
    }

    def say(role: Role, index: int, known: tuple[float, float, float], how: str) -> None:
        unit = get(effect_of(role)).coefficients[index].unit
        out.append(Estimate(estimate_name(role, index), *known, unit, IDENTIFIED, how))

    any_of = [k for k in kinds if k in kept]
    for kind in any_of:
        role, first = kinds[kind]
        for i, axis in enumerate("xy"):
            say(role, first + i, read.interval(_value(f"{kind} {axis}"), False), how)
    if "vertical drag" in kept:
        say(Role.BODY_DRAG, 2, read.interval(lambda v: v["linear drag z"], False), how)
    if "inflow" in kept:
        known = read.interval(lambda v: v["rotor drag z"], False)
        say(Role.INFLOW_THRUST, 0, known, "force along body z")
    if "lift" in kept:
        known = read.interval(lambda v: v["lift"] / 4.0, False)
        say(Role.TRANSLATIONAL_LIFT, 0, known, "force along body z")
    for i, axis in enumerate("xyz"):
        if f"damping {axis}" in kept:
            known = read.interval(_value(f"damping {axis}", arm))
            say(Role.RATE_DAMPING, i, known, f"{sources.rate} against its own derivative")
    if not any_of:
        out.append(
            Estimate(
                "drag",
                0.0,
                math.nan,
                math.nan,
                "N/(m/s)",
                NOTHING,
                "none stands out of the disturbances",
            )
        )
