"""A vehicle from nothing but its mass and its logs.

The mass turns specific force into force, so the force along body z gives the thrust coefficient.
Turning shows torque over inertia: with given rotor positions, roll and pitch yield the inertia
about x and y. Yaw alone gives reaction torque over the inertia about z. Yaw beside roll or pitch
separates the two, since ``w x J w`` then shows the inertia itself. Quantities missing from a flight
are fixed by a named assumption, or left out.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, replace

import numpy as np

from ...dynamics.effects import Role
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ...runtime.threads import one_thread
from ..logs.flight_log import Logs
from ..logs.magnitudes import motor_doubts
from ..logs.screening import check_conventions
from ..logs.table import Pair
from .assemble import vehicle_of
from .channels import Pieces, Sources, pieces_of, rounding_step, speed_noise
from .closed_loop import UNITS
from .columns import ANSWERED_HZ
from .effect_settings import LAG
from .estimates import estimates_of, thrust_of
from .geometry import YAW_REACH, Geometry, Interval
from .held_out import HeldOut, held_out, loops_of, models_of
from .model import Model
from .motors import motor_response
from .parameters import FORCE_BIAS, FURTHER, POSED_BIAS, QUANTITIES, first_model
from .plausible import check_thrust
from .result import (
    ASSUMED,
    IDENTIFIED,
    NOTHING,
    REFUTED,
    Estimate,
    Estimated,
    Identified,
    text_of,
    told,
)
from .solve import VehicleFit, nearest_body, score_tests, solve
from .spectra import BAND

Report = Callable[[float, str], None]

# fall of twice the negative log-likelihood for each further parameter, in units of ln(count of
# frequencies): Schwarz's criterion, doubled since the noise's spectrum is fitted too
_PENALTY = 2.0
# Hz: narrower bands, in turn, where the whole band contradicts itself
_BANDS = (4.0, 1.5)
_APART = 3.0  # standard deviations of thrust between two bands, or of a bias' prior
_CLOSE = 0.01  # share of thrust: two bands may differ by it at any interval
_LEAST_VOLTAGE_RANGE = 0.03  # share: no exponent is fitted to a smaller range of voltage
_LEAST_LAG = 4.0  # standard deviations of a lag behind logged rotor speeds
_NO_OFFSET = 1e-6  # s, deviation of an absent time offset
_ALIGNMENTS = 4  # at most, each by the offset of the fit before
_LAGS = (0.03, 0.08)  # s, starts of the search for a lag
# largest thrust of the same rotor speeds among flights over the smallest: 1.035 within each of four
# vehicles (64 measured flights), 1.15 on a fifth. Above, a warning, and a refusal
_ALIKE, _OTHER = 1.1, 1.5
WITHOUT_FORCE = "an unchanged velocity predicts data outside the fit better than the force"
WITHOUT_EFFECTS = "drag and thrust alone predict data outside the fit better"
HIDDEN = "the interval of the flight loop's reaction holds 0"
LOOP = "predictions of half a second from states of the flight: no part of the vehicle"


@one_thread()
def identify(
    logs: Logs,
    mass: float,
    geometry: Geometry,
    windows: Sequence[Pair] | None = None,
    name: str = "identified",
    report: Report = lambda share, text: None,
) -> Identified:
    """Return the vehicle of some flights.

    Args:
        logs: flights of one vehicle, all with rotor speeds or all with motor commands, and with an
            accelerometer and a gyro, or a pose.
        mass: kg.
        geometry: the rotors' positions, known or not.
        windows: for each log, from and to in s after its start; None: the whole log.
        name: the vehicle's name.
        report: takes the finished share, and the step in words.

    Raises:
        InputError: the logs lack a channel, or contradict the rotors' order.
    """
    if not 0.0 < mass < math.inf:
        raise InputError(f"--mass {mass:g}: expected the vehicle's mass in kg")
    if not logs:
        raise InputError("identify: no log is given; expected one or more of a vehicle")
    pieces, sources = checked_pieces(logs, windows)
    kept = sorted({piece.log for piece in pieces})
    pieces = [piece._replace(log=kept.index(piece.log)) for piece in pieces]
    notes = []
    for i, log in enumerate(logs):
        doubts = ["left out: no piece of 3 s in flight is unbroken in pose and sensors"]
        if i in kept:
            doubts = check_conventions(log, None)
            if "payload_position" in log.extra:
                doubts.append("a load is tracked: --mass is that of the vehicle with its load")
        notes += [f"warning: {log.name}: {text}" for text in doubts]
    logs = [logs[i] for i in kept]
    if text := _unlike(logs, pieces, sources, _ALIKE):
        notes.append(f"warning: {text}")
    basic, step = Model(mass, geometry, sources, voltage_ref=_voltage(pieces)), 0.0
    if not basic.commands:
        basic, step = replace(basic, speed_noise=speed_noise(pieces)), rounding_step(logs)
    report(0.05, "fitting forces and torques")
    fit = _first_fit(pieces, basic)
    report(0.4, "asking whether slow and quick motion agree")
    fit = _agreeing(fit)
    if sources.force == "accelerometer" and sources.velocity:
        biases = dict.fromkeys(QUANTITIES["biases"], POSED_BIAS)
        fit = fit.again(prior={**fit.model.prior, **biases})
    report(0.5, "asking what else shows")
    fit = _with_optional(fit)
    report(0.8, "asking what can be told")
    motors = None if basic.commands or "lag" in fit.model.free else motor_response(pieces)
    doubt = "quick motion contradicts slow motion in these logs" * (fit.model.band < BAND)

    def described(part: VehicleFit, why: str) -> tuple[Estimated, Vehicle]:
        part, _ = nearest_body(replace(part, doubt=doubt or why))
        named = estimates_of(part)
        return named, vehicle_of(name, part, named, logs, step, motors)

    report(0.9, "predicting what is held out")
    tested = held_out(logs, fit, lambda part, why: described(part, why)[1])
    named, vehicle = described(fit, tested.why)
    check_thrust(vehicle, not basic.commands, logs[0].name)
    _, excess = nearest_body(fit)
    given = {"band": BAND, "answered_hz": ANSWERED_HZ, "apart": _APART, "usual": YAW_REACH}
    notes += text_of("doubts", fit=fit, excess=excess, named=named, **given).splitlines()
    vehicle = _with_status(vehicle, named, tested)
    if "lag" in fit.model.free:
        named["lag without offset"] = _lag_alone(fit)
    if motors is not None:
        how = (
            f"rotor speeds against commands, {100 * motors.left:.0f} % of their variation left over"
        )
        named[LAG] = Estimate(LAG, *motors.known, "s", IDENTIFIED, how)
    return Identified(
        vehicle,
        named,
        fit,
        tuple(notes),
        tuple(text_of("advice", known=named, lag=LAG).splitlines()),
        tested.errors,
    )


def _with_status(vehicle: Vehicle, named: Estimated, tested: HeldOut) -> Vehicle:
    """Return the vehicle that stands, with its status; mark what is refuted in ``named``, and add
    the loop's coefficients.
    """
    models = models_of(vehicle)
    if tested.loop is not None:
        loop, deviations = tested.loop
        vehicle = replace(vehicle, closed_loop=loop)
        stands = REFUTED if tested.stands in models else IDENTIFIED
        models |= loops_of(vehicle)
        for size, (c, unit), value in zip(deviations, UNITS.items(), astuple(loop), strict=True):
            name, wide = f"closed_loop {c}", 1.96 * size
            if size > 0.0:
                shows = (stands, LOOP) if abs(value) > wide else (NOTHING, HIDDEN)
                named[name] = Estimate(name, value, value - wide, value + wide, unit, *shows)
    flown = models.get(tested.stands, vehicle)
    gone = {effect.name for effect in vehicle.effects if effect not in flown.effects}
    for name, e in named.items():
        status, how = e.status, e.how
        if name.split()[0] in gone:
            status, how = REFUTED, WITHOUT_EFFECTS
        elif status == IDENTIFIED and not tested.stands:
            status, how = ASSUMED, f"{how}; nothing could be held out"
        elif status == IDENTIFIED and e.of_force and flown.status.force == REFUTED:
            status, how = REFUTED, WITHOUT_FORCE
        named[name] = e._replace(status=status, how=how)
    known = {e.name: e.status for e in named.values() if e.status != NOTHING}
    return replace(flown, status=replace(flown.status, coefficients=known))


def _lag_alone(fit: VehicleFit) -> Estimate:
    """Return the lag of a model without a time offset: the offset is then part of the lag."""
    start = np.where([name == "delay" for name in fit.model.free], 0.0, fit.theta)
    alone = fit.again(start, prior={**fit.model.prior, "delay": _NO_OFFSET})
    known = alone.interval("lag")
    status, how = IDENTIFIED, "of a model without a time offset: what other tools call the lag"
    if not told(known):
        status, how = NOTHING, "the interval is wider than half the value"
    return Estimate("lag without offset", *known, "s", status, how)


def checked_pieces(logs: Logs, windows: Sequence[Pair] | None = None) -> tuple[Pieces, Sources]:
    """Return the pieces of the logs for an identification, and their sensors.

    Raises:
        InputError: the logs lack a channel, their motors are doubtful, or several vehicles flew.
    """
    pieces, sources = pieces_of(logs, windows or [(0.0, math.inf)] * len(logs))
    for log in logs:
        for wrong in motor_doubts(log):
            raise InputError(f"{log.name}: {wrong}")
    if text := _unlike(logs, pieces, sources, _OTHER):
        raise InputError(text)
    return pieces, sources


def _unlike(logs: Logs, pieces: Pieces, sources: Sources, most: float) -> str:
    """Return the two flights with thrusts of equal rotor speeds apart by more than a factor."""
    each = [(p.specific_force[:, 2].sum() / np.square(p.rotors).sum(), p.log) for p in pieces]
    (low, one), (high, other) = min(each), max(each)
    if sources.rotors == "commands" or not high > most * low:
        return ""
    return (
        f"{logs[other].name}: the same rotor speeds give {high / low - 1.0:.0%} more thrust than "
        f"on {logs[one].name}; expected flights of one vehicle with one mass and one set of "
        "propellers"
    )


def _voltage(pieces: Pieces) -> float:
    voltages = [p.voltage for p in pieces if p.voltage is not None]
    if len(voltages) < len(pieces):
        return 0.0
    low, middle, high = np.quantile(np.concatenate(voltages), [0.05, 0.5, 0.95])
    return middle if high - low > _LEAST_VOLTAGE_RANGE * middle > 0.0 else 0.0


def _first_fit(pieces: Pieces, basic: Model) -> VehicleFit:
    """Return the fit of the basic model."""
    if not basic.commands:
        model, start = first_model(pieces, basic, "delay")
        plain = _aligned(solve(pieces, model, start))
        # do the logged speeds lead the motion as commands do? An offset passes for a lag and a lag
        # for an offset: the search starts from both
        model, start = plain.model.with_more(plain.theta, "lag")
        start[-1] = _LAGS[0]
        both = [_aligned(solve(pieces, replace(model, late=x), start)) for x in (0.0, model.late)]
        other = min(both, key=lambda f: f.loss)
        lag, low, _ = other.interval("lag", logarithm=False)
        sure = lag > _LEAST_LAG * (lag - low) / other.width
        return other if sure and plain.loss - other.loss > _cost(plain, 1) else plain
    nonlinear = ("delay", *(("gamma",) if basic.voltage_ref > 0.0 else ()), "lag")
    least, best, lags = math.inf, None, [*_LAGS]
    # from the richest curve down: a poor first fit takes its own misfit for noise
    for exponents in ((0, 1, 2), (1, 2), (2,)):
        model, start = first_model(pieces, replace(basic, exponents=exponents), *nonlinear)
        fits = [_aligned(solve(pieces, model, np.append(start[:-1], lag))) for lag in lags]
        fit = min(fits, key=lambda f: f.loss)
        cost = fit.loss + _cost(fit, len(exponents))
        thrust = [thrust_of(fit.values, u) for u in np.linspace(0.05, 1.0, 20)]
        rises = np.all(np.diff(thrust) > 0.0)  # with the command, from nothing to full
        if rises and cost < least:
            least, best, lags = cost, fit, [fit.values["lag"]]
    if best is None:
        raise InputError(
            "thrust does not grow with the motor commands; expected cmd1..cmd4, 0 to 1"
        )
    return best


def _aligned(fit: VehicleFit) -> VehicleFit:
    """Return the fit with the rotors' columns set back by its own time offset, to a sample."""
    for _ in range(_ALIGNMENTS):
        late = fit.values["delay"]
        if abs(late - fit.model.late) < fit.balance.pieces[0].period:
            break
        fit = fit.again(late=late)
    return fit


def _agreeing(fit: VehicleFit) -> VehicleFit:
    """Return the fit up to the highest frequency without a contradiction: thrust agrees with slower
    motion alone (Hausman's test), and each sensor's bias is credible.
    """
    for band in _BANDS:
        slow = fit.again(band=band)
        (wide, *_), (narrow, low, _) = _hover_thrust(fit), _hover_thrust(slow)
        credible = abs(fit.values.get("force bias z", 0.0)) < _APART * FORCE_BIAS
        if credible and min(wide, narrow) > 0.0:
            deviation = math.hypot(math.log(narrow / low) / slow.width, _CLOSE)
            if abs(math.log(narrow / wide)) <= _APART * deviation:
                return fit
        fit = slow
    return fit


def _hover_thrust(fit: VehicleFit) -> Interval:
    """Return one rotor's thrust at the hover speed or command of the fit's start."""
    # the start's curve carries the weight here; each power carries its share
    u = math.sqrt(fit.model.weight / (4.0 * fit.model.scale["a2"]))
    return fit.interval(lambda v: thrust_of(v, u))


def _cost(fit: VehicleFit, parameters: int) -> float:
    """Return the least fall of twice the negative log-likelihood for further parameters."""
    frequencies = sum(len(s.frequency) for s in fit.balance.segments)
    return _PENALTY * parameters * math.log(6 * frequencies)


def _above(fit: VehicleFit, name: str) -> float:
    """Return the size of a further effect above the bound of the search, standard deviations."""
    at = [fit.model.free.index(p) for p in FURTHER[name].parameters]
    theta, covariance = fit.theta[at], fit.covariance[np.ix_(at, at)]
    size = math.sqrt(theta @ np.linalg.solve(covariance, theta))
    return size - math.sqrt(_cost(fit, len(at)))


def _with_optional(fit: VehicleFit) -> VehicleFit:
    """Return a fit with further effects, and a hidden moment of velocity.

    Effects join if the logs get much likelier, the likeliest first, lest another stands for it.
    """
    moving, rate = fit.model.sources.velocity, fit.model.sources.rate
    offered = {
        name: tuple(further.parameters)
        for name, further in FURTHER.items()
        if (moving or further.role in ("", Role.RATE_DAMPING))
        and not (fit.model.commands and further.of_speeds)
        # the noise of a pose goes round the loop: quick torques then follow noise alone
        and (name != "answered torque" or rate == "gyro")
    }
    kept: list[str] = []
    hidden = None
    while offered:
        tests = score_tests(fit, offered)
        falls = {name: tests[name][0] - _cost(fit, len(offered[name])) for name in offered}
        name = max(falls, key=falls.__getitem__)
        if falls[name] <= 0.0:
            if "flapping" in tests:
                _, value, size = fit.model.scale["flapping"] * np.hstack(tests["flapping"])
                hidden = value, size, math.sqrt(_cost(fit, 1)) * size
            break
        richer = solve(fit.balance.pieces, *fit.model.with_more(fit.theta, *offered.pop(name)))
        asked = [FURTHER[n] for n in (*kept, name)]
        if all(richer.values[p] > 0.0 for f in asked if f.positive for p in f.parameters):
            fit = richer
            kept.append(name)
    # An effect taken because it stood out is too large on average, if another flight of the same
    # vehicle would hide it: its interval reaches down to sizes below the bound. The weakest one
    # leaves, since another may stand for it: of linear and quadratic drag each can be too weak
    while kept and _above(fit, name := min(kept, key=lambda n: _above(fit, n))) < fit.width:
        kept.remove(name)
        stays = [p not in FURTHER[name].parameters for p in fit.model.free]
        free = tuple(p for p, stay in zip(fit.model.free, stays, strict=True) if stay)
        fit = fit.again(fit.theta[stays], free=free)
    return replace(fit, kept=tuple(kept), hidden=hidden)
