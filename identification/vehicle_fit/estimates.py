"""From fitted parameters to a vehicle's estimates: values with intervals, and assumptions in place
of quantities missing from the flight.
"""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.optimize import brentq

from ...dynamics.effects import Role, get
from ...runtime.errors import InputError
from ..logs.table import Values
from .effect_settings import LAG, effect_of
from .geometry import (
    COMMAND_SPREAD,
    FLAT,
    GYRATION,
    THRUST_SPREAD,
    VOLTAGE_EXPONENTS,
    YAW_REACH,
    Interval,
)
from .parameters import FURTHER
from .result import ASSUMED, GIVEN, IDENTIFIED, NOTHING, Estimate, Estimated, told
from .solve import Function, VehicleFit

UNKNOWN = (math.nan, math.nan, math.nan)
UNIT = (1.0, 1.0, 1.0)
Estimates = Iterator[Estimate]


def thrust_of(values: Values, u: float) -> float:
    """Return one rotor's thrust (N) at a speed in rad/s or a command."""
    return sum(values.get(f"a{e}", 0.0) * u**e for e in range(3))


def _times(known: Interval, by: Interval | float) -> Interval:
    """Return the product of an interval and another, or a number."""
    value, *ends = by if isinstance(by, tuple) else (by, by)
    corners = [x * end for x in known[1:] for end in ends]
    return known[0] * value, min(corners), max(corners)


def estimates_of(fit: VehicleFit) -> Estimated:
    """Return the estimate of every quantity of a vehicle.

    Raises:
        InputError: neither turning nor an arm says how large the vehicle is.
    """
    thrust = (e._replace(of_force=True) for e in _thrust(fit))
    said = {e.name: e for e in (*thrust, *_size(fit))}
    # m for each unit of the rotors' positions
    arm = UNIT if fit.model.geometry.known else said["arm_l"][1:4]
    further = (*_yaw(fit, said, arm), *_lag(fit), *_centre(fit, arm), *_air(fit, arm))
    return said | {e.name: e for e in further}


def _estimate(
    name: str,
    known: Interval,
    unit: str,
    how: str,
    doubt: str = "",
    status: str = IDENTIFIED,
) -> Estimate:
    status, how = (NOTHING, doubt) if doubt else (status, how)
    return Estimate(name, *known, unit, status, how)


def _positive(
    fit: VehicleFit, name: str, what: str | Function, unit: str, how: str, spread: float = 0.0
) -> Estimate:
    """Return the estimate of a positive quantity with a spread from day to day, as a share."""
    known = value, low, high = fit.interval(what)
    if spread and low > 0.0:
        factor = math.exp(math.hypot(math.log(high / value), 1.96 * spread))
        known = value, value / factor, value * factor
        how = f"{how}; the interval includes {100.0 * spread:g} % from day to day"
    wide = f"{how}: the interval is wider than half the value"
    return _estimate(name, known, unit, how, "" if told(known) else wide)


def _thrust(fit: VehicleFit) -> Estimates:
    """Yield the thrust coefficient, or the curve of commands."""
    of, pieces = fit.model.sources, fit.balance.pieces
    how = f"{of.force} along body z against {of.rotors}, with the mass given"
    if not fit.model.commands:
        yield _positive(fit, "k", "a2", "N/(rad/s)^2", how, THRUST_SPREAD)
        return
    for e in fit.model.exponents:
        yield _estimate(f"thrust u^{e}", fit.interval(f"a{e}", False), "N", how)
    flown = np.concatenate([p.rotors for p in pieces])
    low, high = np.clip(np.quantile(flown, [0.005, 0.995]), 0.0, 1.0)
    beyond = f"continues the curve beyond the commands flown, {low:.2f} to {high:.2f}"
    for u in (0.25, 0.5, 0.75, 1.0):
        name, thrust = f"thrust({u:g})", partial(thrust_of, u=u)
        if low <= u <= high:
            yield _positive(fit, name, thrust, "N", how, COMMAND_SPREAD)
        else:
            yield _estimate(name, fit.interval(thrust), "N", beyond, status=ASSUMED)

    def hover(values: Values, share: float = 1.0) -> float:
        weight = fit.model.weight * math.pow(share, -values.get("gamma", 0.0))

        def excess(u: float) -> float:
            return 4.0 * thrust_of(values, u) - weight

        # a curve of few flights may carry the weight at no command, or at none up to 2
        low, high = excess(0.0), excess(2.0)
        return float(brentq(excess, 0.0, 2.0)) if low < 0.0 < high else 2.0 * (low < 0.0)

    yield _positive(fit, "hover command", hover, "1", how)
    voltages = [p.voltage for p in pieces if p.voltage is not None]
    if "gamma" in fit.model.free:
        known, how = fit.interval("gamma", False), f"{how} and voltage"
        together = "command and voltage change together: what the voltage does, the curve may do"
        why = together * (known[2] - known[1] > VOLTAGE_EXPONENTS)
    else:
        logged = len(voltages) == len(pieces)
        known, why = UNKNOWN, "the voltage hardly changes" if logged else "no voltage is logged"
        why += ": the curve holds for the voltage of these flights"
    yield _estimate("voltage_exponent", known, "1", how, why)
    if not why:
        for volts in np.quantile(np.concatenate(voltages), [0.05, 0.95]).tolist():
            at_voltage = partial(hover, share=volts / fit.model.voltage_ref)
            yield _positive(fit, f"hover command at {volts:.2f} V", at_voltage, "1", how)


def _size(fit: VehicleFit) -> Estimates:
    """Yield arm and inertia.

    Raises:
        InputError: neither turning nor an arm says how large the vehicle is.
    """
    geometry, mass, rate = fit.model.geometry, fit.model.mass, fit.model.sources.rate
    rotors = f"against {fit.model.sources.rotors}"
    motions = {"Jx": "roll", "Jy": "pitch", "Jz": "yaw while rolling or pitching"}
    known = {axis: fit.interval(axis) for axis in motions}
    flat = known["Jz"][0] / (known["Jx"][0] + known["Jy"][0])
    why = {
        axis: fit.doubt or f"the flight hardly shows {motion}"
        for axis, motion in motions.items()
        if fit.doubt or not told(known[axis]) or (axis == "Jz" and not 0.3 < flat < 1.3)
    }
    arm, status, given = UNIT, IDENTIFIED, "given"
    if geometry.known:
        yield _estimate("arm_l", 3 * (geometry.arm,), "m", "--geometry", status=GIVEN)
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
        arm, status, given = (value, low, high), ASSUMED, "assumed"
        yield _estimate("arm_l", arm, "m", how, status=ASSUMED)
    both = np.zeros(3)  # Jxx + Jyy
    for axis, motion in motions.items():
        size, how = _times(known[axis], arm), f"{rate} in {motion} {rotors}, with the arm {given}"
        if axis in why:
            size, how = _times(GYRATION, mass * geometry.arm**2), f"{GYRATION[0]:g} mass arm^2"
            if axis == "Jz":
                size, how = _times(FLAT, (*both,)), "{:g} of Jxx + Jyy, {:g} to 1".format(*FLAT)
            how = f"{why[axis]}; {how}"
        both += size
        yield _estimate(axis + axis[1], size, "kg m2", how, "", ASSUMED if axis in why else status)
    for axis, across in (("Jx", 1), ("Jy", 0)):
        if axis not in why:
            length = np.abs(geometry.positions[:, across]).mean()
            value, high, low = (length / x for x in known[axis])
            how = f"{rate} {rotors}: needs no arm"
            yield _estimate(f"l/{axis}{axis[1]}", (value, low, high), "1/(kg m)", how)
    for name in ("Jxy", "Jxz", "Jyz") if "products of inertia" in fit.kept else ():
        product = _times(fit.interval(name, False), arm)
        yield _estimate(name, product, "kg m2", f"{rate} across axes", fit.doubt, status)


def _yaw(fit: VehicleFit, said: Estimated, arm: Interval) -> Estimates:
    """Yield reaction torque over thrust."""
    of = fit.model.sources
    how = f"{of.rate} in yaw against {of.rotors}"
    gain = fit.interval(lambda v: v["reach"] / v["Jz"])
    inertia, status, k = said["Jzz"], ASSUMED, said.get("k")
    doubt = fit.doubt or ("" if told(gain) else "the flight hardly accelerates in yaw")
    yield _estimate("(p/k)/Jzz", gain, "1/(kg m)", how, doubt)
    ratio, product = _times(gain, inertia[1:4]), None
    if doubt:
        length = fit.model.geometry.arm * arm[0]
        ratio, how = _times(YAW_REACH, length), f"{doubt}; {YAW_REACH[0]:g} of the arm"
    elif inertia.status == ASSUMED:
        # the flight tells the gain alone: p/k carries the assumption of Jzz
        how = f"{how}, with the Jzz that is assumed"
    else:
        ratio, status = _times(fit.interval("reach"), arm), IDENTIFIED
        product = fit.interval(lambda v: v["reach"] * v["a2"])
    yield _estimate("p/k", ratio, "m", how, status=status)
    if k is not None:
        yield _estimate("p", product or _times(ratio, k.value), "Nm/(rad/s)^2", how, status=status)


def _lag(fit: VehicleFit) -> Estimates:
    """Yield the rotors' lag, and the time offset of the motion."""
    known, status = UNKNOWN, NOTHING
    how = (
        "force follows the logged rotor speeds at once: they are measured, and no command is "
        "logged beside them"
    )
    if "lag" in fit.model.free:
        known, how = fit.interval("lag"), f"force and turning against {fit.model.sources.rotors}"
        how += ", which therefore are commanded, not measured" * (not fit.model.commands)
        alike = "a time offset of the motion does nearly the same here"
        doubt = fit.doubt or alike * (not told(known))
        # without the fit's value the thrust would come early
        status, how = (ASSUMED, doubt) if doubt else (IDENTIFIED, how)
    yield Estimate(LAG, *known, "s", status, how)
    offset = fit.interval("delay", False)
    yield _estimate("time_offset", offset, "s", "of the motion behind the rotors")


def _centre(fit: VehicleFit, arm: Interval) -> Estimates:
    """Yield the centre of mass."""
    model = fit.model
    how = (
        "constant share of thrust in roll and pitch torque: a centre of mass off the rotors' "
        "middle, or unequal rotors"
    )
    steady = "thrust hardly changes: a constant torque does the same"
    swing = "the pose's point swings about it: or the markers' middle is off"
    widest = 0.5 * arm[0] * model.geometry.arm
    status = IDENTIFIED if model.geometry.known else ASSUMED
    for axis in "xy":
        known = _times(fit.interval(f"c{axis}", False), arm[0])
        unsure = steady * (known[2] - known[1] > widest)
        yield _estimate(f"com {axis}", known, "m", how, fit.doubt or unsure, status)
    if model.sources.force == "pose":
        known = fit.interval(lambda v: -v["rz"], False)
        yield _estimate("com z", known, "m", swing, swing * (known[2] - known[1] > widest))


def _air(fit: VehicleFit, arm: Interval) -> Estimates:
    """Yield the effects of moving through the air."""
    of = fit.model.sources
    if not of.velocity:
        why = "no velocity is known: the logs have no position"
        yield _estimate("drag", UNKNOWN, "N/(m/s)", "", why)
        return
    for kind, effect in FURTHER.items():
        if not effect.role or kind not in fit.kept:
            continue
        size = effect.factor * (arm[0] if effect.turns else 1.0)
        why, how = fit.doubt * effect.turns, effect.how.format(**vars(of))
        for index, parameter in enumerate(effect.parameters, effect.first):
            known = _times(fit.interval(parameter, effect.turns), size)
            estimate = _of_effect(effect.role, index, known, how, why)
            yield estimate._replace(of_force=not effect.turns)
    if fit.hidden:
        value, deviation, least = (arm[0] * x for x in fit.hidden)
        wide = fit.width * deviation
        why = fit.doubt or (
            f"unmeasured moments hide values below {least:.2g}. Fly faster to and fro, and longer"
        )
        known = value, value - wide, value + wide
        yield _of_effect(Role.FLAPPING_MOMENT, 0, known, "", why)
    if not {"rotor drag", "linear drag", "quadratic drag"} & set(fit.kept):
        why = "none stands out of the disturbances"
        yield _estimate("drag", (0.0, math.nan, math.nan), "N/(m/s)", "", why)


def _of_effect(role: str, index: int, known: Interval, how: str, doubt: str) -> Estimate:
    """Return the estimate of a coefficient of a role's effect."""
    effect = effect_of(role)
    coefficient = get(effect).coefficients[index]
    return _estimate(f"{effect} {coefficient.name}", known, coefficient.unit, how, doubt)
