"""Whether the residual after all named effects still has structure, so that a name may stand for
another effect.

A library that lacks the true effect explains it by a similar one, down to the noise floor. Small
signs show it: candidate regressors still explain part of the residual; the coefficient of the named
effect changes with speed, height, load, time or frequency; or its force differs between channels.
Each column is tried alone, on blocks that are left out in turn.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Family, Role, get, of_family, playing
from ..findings import CHANNELS, Structure
from ..motion.smoothing import CUTOFFS, low_pass
from .candidate_regressors import (
    drag_by_place,
    drag_regressors,
    explanatory_variables,
    general_regressors,
    place_regressors,
    resonant_regressors,
    standardised,
)
from .gram_matrix import Gram
from .innovations import Innovations, confirms_addition
from .regression import (
    CENTRAL,
    REGRESSION,
    Column,
    Flights,
    Setting,
    moves_time,
)
from .search import SEARCH, FittedEffects, Search

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StructureSettings:
    """From which deviance on, a candidate regressor shows an effect that the model lacks.

    Deviances are on left-out blocks, if nothing else is said.
    """

    # deviance that a column must explain; where nothing is lacking few flights have a column
    # above 25
    least_deviance_reduction: float = 40.0
    least_share_of_residual: float = 0.004  # of the residual's deviance, the same
    # of the deviance that the named effects explain: effect models, and the plant in which they
    # act, are true to one per cent
    least_share_of_named: float = 1e-4
    # reduction over the root of the blocks' summed squares: an effect acts again and again, a
    # transient disturbance once; the second is for commanded flights, where innovations confirm
    # nothing
    least_spread: float = 1.5
    commanded_least_spread: float = 2.0
    # times the least reduction, from which the least spread is smaller: an effect that acts in one
    # part of a flight, but strongly
    large_reduction_ratio: float = 3.0
    least_spread_of_large: float = 1.0
    # of columns that are tried together, as a share of their mean square sum; from 0.03 to 0.3
    # little changes
    ridge: float = 0.1
    # factor on the least reduction where rotor speeds hardly leave their rounding steps
    rounded_rotor_factor: float = 4.0
    batch: int = 24  # columns at a time
    # standard deviations beyond chance, and relative standard deviation of a coefficient from block
    # to block; true effects have at most 3 of the first
    least_scatter_significance: float = 5.0
    least_scatter: float = 0.1
    # deviance of one question, whether a drag grows with another power of speed: 93 true drags had
    # up to 5
    least_reduction_of_power: float = 7.0
    # the same where the exponent is off by so much or more; on two flights on a circle, at one
    # speed, a third of a friction had 6.4 and 8.1
    large_exponent_error: float = 0.5
    least_reduction_of_large_exponent: float = 4.0
    least_speed: float = 0.05  # m/s, below which speed is noise
    thrust_bends: tuple[float, ...] = (0.9, 1.0, 1.1, 1.2, 1.3)  # times the thrust of hover
    # deviance of one question, whether thrust bends: 36 true curved thrusts had up to 4, rotors
    # that stall 29 to 680; where no curvature is named, 93 flights without a bend had up to 17 that
    # innovations confirmed, a rotor that stalls 56
    least_reduction_of_bend: float = 12.0
    least_reduction_of_stall: float = 25.0
    # of the deviance that a rigid effect explains, which its slow motion alone must explain: beyond
    # the least reduction true ones had up to 0.007 (one 0.3), loose cameras 0.04 to 2.3
    least_share_of_loose_mount: float = 0.02
    # deviance of an effect in the residual, and in the innovations, that is too much for no name
    least_residual_hint: float = 10.0
    least_innovation_hint: float = 50.0
    most_signs: int = 12  # reported, the strongest first
    most_confirmations: int = 36  # columns asked of the innovations, which takes time


STRUCTURE = StructureSettings()


def find_structure(search: Search, fit: FittedEffects) -> tuple[list[Structure], bool]:
    """Return the strongest signs of structure in the residual of a fit, the strongest first, and
    whether there seemed to be any.

    Structure that the innovations do not confirm may be a feedback-induced correlation.
    """
    flights = search.flights
    regression = search.gram_at(fit)
    error = regression.error(np.arange(len(regression.columns)))
    unit = max(
        1.0, error / regression.design[..., 0].size
    )  # of chance, where the noise model is wrong
    residual = flights.residual(fit.setting)
    base = flights.columns(fit.setting, regression.columns, 0.1)
    every = search.deviance_of(flights.residual(fit.without(*fit.effects).setting) - residual)
    words: list[tuple[str, str]] = []
    columns: list[Array] = []
    named: list[float] = []  # deviance of the effects whose model error a column may be
    asked = (
        [general_regressors]
        if flights.commanded
        else [general_regressors, place_regressors, drag_regressors, resonant_regressors]
    )
    for channel_words, drive, column in itertools.chain.from_iterable(
        ask(flights, fit.setting) for ask in asked
    ):
        words.append(("a candidate regressor", f"{channel_words} with {drive}"))
        columns.append(column)
        named.append(every)
    known = standardised(explanatory_variables(flights, fit.setting))
    # a fixed effect was not fitted to these forces
    shares = {
        e: _explained_part(flights, fit, e, residual) for e in fit.effects if not search.is_fixed(e)
    }
    for effect, share in shares.items():
        for name, x in known.items():
            words.append((f"{effect}'s coefficient is not constant", f"it changes with {name}"))
            columns.append(share * x[:, None])
        rotorwise = any(
            c.name == CENTRAL for c in get(effect).coefficients
        )  # its moment is free in any case
        for channel in range(3 if rotorwise else 6):
            words.append((f"{effect}'s channels do not agree", f"{CHANNELS[channel]} differs"))
            columns.append(np.zeros_like(share))
            columns[-1][:, channel] = share[:, channel]
        named += [search.deviance_of(share)] * (len(columns) - len(named))
    rough = 1.0 if flights.rotor_speeds_vary else STRUCTURE.rounded_rotor_factor
    least_of_all = max(
        STRUCTURE.least_deviance_reduction * unit, STRUCTURE.least_share_of_residual * error
    )
    least = rough * np.maximum(least_of_all, STRUCTURE.least_share_of_named * np.array(named))
    steady = STRUCTURE.commanded_least_spread if flights.commanded else STRUCTURE.least_spread
    found = []
    for at in range(0, len(columns), STRUCTURE.batch):
        batch = columns[at : at + STRUCTURE.batch]
        gains, spreads = _gains(search, regression, np.stack(batch, axis=2))
        for i, (column, gain, spread) in enumerate(zip(batch, gains, spreads, strict=True), at):
            if gain > least[i] and spread >= (
                steady
                if gain < STRUCTURE.large_reduction_ratio * least[i]
                else STRUCTURE.least_spread_of_large
            ):
                found.append((Structure(*words[i], float(gain) / error), column))
    if not flights.commanded and (group := drag_by_place(flights, fit.setting)):
        together, column = _joint_regression(search, regression, group)
        if together > rough * max(least_of_all, STRUCTURE.least_share_of_named * every):
            where = "a drag with position and heading together"
            found.append((Structure("a candidate regressor", where, together / error), column))
    found.sort(key=lambda x: -x[0].gain)
    if flights.commanded:
        return [sign for sign, _ in found[: STRUCTURE.most_signs]], bool(found)
    block_signs = [
        *varying_coefficients(search, shares, regression),
        *drag_exponents(search, shares, regression, base),
        *bending_thrust(search, fit, regression, base),
        *loose_mounts(search, shares, regression, base),
    ]
    if not found:
        # a filtered pose has no innovations
        signs = block_signs or ([] if flights.filtered else list(innovation_hints(search, fit)))
        return signs, bool(signs)
    innovations = Innovations(flights, fit.setting)
    confirmed = (
        sign
        for sign, column in found[: STRUCTURE.most_confirmations]
        if innovations.confirm_column(_best_multiple(search, regression, base, column))
    )
    return [*block_signs, *itertools.islice(confirmed, STRUCTURE.most_signs)], True


def varying_coefficients(
    search: Search, shares: Mapping[str, Array], regression: Gram
) -> Iterator[Structure]:
    """Yield a sign for each effect whose coefficient changes from block to block by more than
    chance.

    Args:
        search: that found the effects.
        shares: what each explains (rows, 6).
        regression: on the columns of the fit.

    An effect is the same throughout a flight; a disturbance that comes and goes, and has a mean,
    looks like one. Each block has its own multiple of the effect; their scatter is the moment
    estimate of a random coefficient's variance (T. S. Breusch and A. R. Pagan, Econometrica 47
    (1979), 1287-1294, have the test).
    """
    whole = regression.blocks[:, -1, -1].sum()
    unit = max(1.0, float(whole) / regression.design[..., 0].size)
    for effect, share in shares.items():
        x = search.whiten(share)[search.flights.fit_rows]
        slope = np.add.reduceat(np.sum(x * regression.design[..., -1], axis=1), regression.begins)
        size = np.add.reduceat(np.sum(x * x, axis=1), regression.begins)
        beyond = float(np.sum(slope**2) - unit * np.sum(size))
        squares = float(np.sum(size**2))
        scatter = np.sqrt(max(beyond, 0.0) / max(squares, 1e-30))
        if (
            beyond > STRUCTURE.least_scatter_significance * unit * np.sqrt(2.0 * squares)
            and scatter > STRUCTURE.least_scatter
        ):
            words = (
                f"it changes by {scatter:.0%} from one {REGRESSION.block:.0f} s block to the next"
            )
            yield Structure(
                f"{effect}'s coefficient is not constant",
                words,
                float(np.sum(slope**2 / np.maximum(size, 1e-30)) / max(whole, 1e-30)),
            )


def drag_exponents(
    search: Search, shares: Mapping[str, Array], regression: Gram, base: Mapping[Column, Array]
) -> Iterator[Structure]:
    """Yield a sign for each named drag whose force grows with another power of speed.

    Args:
        search: that found the effects.
        shares: what each explains (rows, 6).
        regression: on the columns of the fit.
        base: these columns (rows, 6) each.

    It is asked in all rows together: a flight at one speed has another one only as it begins.
    """
    flights = search.flights
    whole = regression.blocks[:, -1, -1].sum()
    drags = of_family(Family.DRAG)
    for effect in filter(drags.__contains__, shares):
        speed = np.concatenate(
            [np.linalg.norm(p.signals.velocity[p.rows], axis=1) for p in flights.pieces({})]
        )
        # weighted towards slow flight, and towards fast flight
        asked = (
            _single_regression(search, regression, base, shares[effect] * x[:, None])
            for x in (np.log(speed.clip(STRUCTURE.least_speed)), speed)
        )
        (exponent, slow), (_, quick) = asked
        gain = max(slow, quick)
        if gain > STRUCTURE.least_reduction_of_power or (
            slow > STRUCTURE.least_reduction_of_large_exponent
            and abs(exponent) > STRUCTURE.large_exponent_error
        ):
            yield Structure(
                f"{effect}'s coefficient is not constant",
                "its force grows with another power of speed",
                gain / max(float(whole), 1e-30),
            )


def bending_thrust(
    search: Search, fit: FittedEffects, regression: Gram, base: Mapping[Column, Array]
) -> Iterator[Structure]:
    """Yield a sign where rotors deliver less, or more, beyond some thrust.

    Args:
        search: that found the effects.
        fit: the effects.
        regression: on the columns of the fit.
        base: these columns (rows, 6) each.

    A rotor that stalls beyond some thrust does so in a few moments of a flight, which are too few
    blocks, and a curved thrust explains most of it: it is asked in all rows together. Where a
    curve of the thrust is named it is also asked whether thrust bends at hover alone; innovations
    need not confirm that.
    """
    flights = search.flights
    curved = bool(playing(Role.THRUST_CURVE, among=fit.effects))
    if not flights.rotor_speeds_vary:
        return
    asked = [
        (
            f"rotor thrust beyond {share:.1f} times the thrust of hover",
            _thrust_beyond(flights, fit.setting, share, 0.0),
        )
        for share in STRUCTURE.thrust_bends
    ]
    if curved:
        asked.append(
            (
                "thrust that bends at one point",
                _thrust_beyond(flights, fit.setting, 1.0, -1.0),
            )
        )
    gains = [_single_regression(search, regression, base, column)[1] for _, column in asked]
    best = int(np.argmax(gains))
    where, column = asked[best]
    stalls = gains[best] > STRUCTURE.least_reduction_of_stall and Innovations(
        flights, fit.setting
    ).confirm_column(_best_multiple(search, regression, base, column))
    if stalls or (curved and gains[best] > STRUCTURE.least_reduction_of_bend):
        yield Structure(
            "a candidate regressor",
            where,
            gains[best] / max(float(regression.blocks[:, -1, -1].sum()), 1e-30),
        )


def _thrust_beyond(flights: Flights, setting: Setting, share: float, below: float) -> Array:
    """Return what rotors deliver (rows, 6) beyond a multiple of their share of the weight, and
    ``below`` times what they deliver below it.
    """
    vehicle, parts = flights.amended(setting), []
    for piece in flights.pieces(setting):
        off = vehicle.k * piece.signals.rotor_speeds**2 - share * flights.vehicle.weight / 4.0
        thrust = np.where(off > 0.0, off, below * off)
        wrench = vehicle.rotor_wrench(np.sqrt(thrust / vehicle.k))
        force = piece.signals.rotation[:, :, 2] * wrench[:, :1]
        parts.append(
            low_pass(
                np.concatenate([force, wrench[:, 1:]], axis=1),
                CUTOFFS.residual_hz,
                piece.signals.period,
            )[piece.rows]
        )
    return np.concatenate(parts)


def loose_mounts(
    search: Search, shares: Mapping[str, Array], regression: Gram, base: Mapping[Column, Array]
) -> Iterator[Structure]:
    """Yield a sign for each named mass, inertia or offset that differs between slow and fast
    motion.

    Args:
        search: that found the effects.
        shares: what each explains (rows, 6).
        regression: on the columns of the fit.
        base: these columns (rows, 6) each.

    A part on a soft mount follows slow motion as if it were bolted on, and fast motion hardly:
    below its resonance it adds to mass and inertia.
    """
    flights = search.flights
    whole = float(regression.blocks[:, -1, -1].sum())
    least = STRUCTURE.least_deviance_reduction * max(1.0, whole / regression.design[..., 0].size)
    rigid = of_family(Family.RIGID_BODY)
    for effect in filter(rigid.__contains__, shares):
        pieces = np.split(shares[effect], np.flatnonzero(flights.start)[1:])
        slow = np.concatenate(
            [low_pass(piece, CUTOFFS.slow_motion_hz, flights.period) for piece in pieces]
        )
        more, gain = _single_regression(search, regression, base, slow)
        if more > 0.0 and gain > max(
            least, STRUCTURE.least_share_of_loose_mount * search.deviance_of(shares[effect])
        ):
            yield Structure(
                f"{effect}'s coefficient is not constant",
                f"it changes below {CUTOFFS.slow_motion_hz:.0f} Hz",
                gain / max(whole, 1e-30),
            )


def innovation_hints(search: Search, fit: FittedEffects) -> Iterator[Structure]:
    """Yield a sign for each effect that the innovations confirm and of which the residual shows too
    little for a name.

    Args:
        search: that found the effects.
        fit: the effects.

    The residual ends at 5 Hz, where an inertia only begins to show; innovations have all
    frequencies. On 129 flights that were diagnosed rightly no other effect of a tenth of its
    typical size had a log-likelihood ratio above 41 there.
    """
    regression = search.linearise(fit)
    for gain in search.gains(fit, regression, search.gram(fit, regression)):
        if (
            gain.deviance_reduction > STRUCTURE.least_residual_hint
            and gain.size > SEARCH.least_size
        ):
            more = search.refit(gain.fit)
            if confirms_addition(
                search.flights, fit.setting, more.setting, STRUCTURE.least_innovation_hint
            ):
                yield Structure(
                    "the innovations confirm what the residual hardly shows",
                    gain.effect,
                    gain.share,
                )


def _explained_part(flights: Flights, fit: FittedEffects, effect: str, residual: Array) -> Array:
    """Return what an effect explains (rows, 6) of the residual without it.

    Moving signals in time also moves their noise, which is in the residual as well: for such an
    effect it is the linear change with its coefficients.
    """
    if not moves_time(effect):
        return flights.residual(fit.without(effect).setting) - residual
    own = fit.setting[effect]
    columns = flights.columns(fit.setting, [(effect, name) for name in own], 0.1)
    return sum(
        (value * columns[effect, name] for name, value in own.items()), np.zeros_like(residual)
    )


def _best_multiple(search: Search, g: Gram, base: Mapping[Column, Array], column: Array) -> Array:
    """Return what the best multiple of a column (rows, 6) adds to a fit with columns ``base``."""
    alone = _orthogonal_part(search, g, base, column)
    x = search.whiten(alone)[search.flights.fit_rows]
    return np.asarray(alone * np.sum(x * g.design[..., -1]) / np.sum(x * x))


def _single_regression(
    search: Search, g: Gram, base: Mapping[Column, Array], column: Array
) -> tuple[float, float]:
    """Return the best multiple of a column (rows, 6) beside the columns ``base`` of a fit, and the
    deviance that it explains.
    """
    x = search.whiten(_orthogonal_part(search, g, base, column))[search.flights.fit_rows]
    slope, size = float(np.sum(x * g.design[..., -1])), max(float(np.sum(x * x)), 1e-30)
    return slope / size, slope**2 / size


def _orthogonal_part(search: Search, g: Gram, base: Mapping[Column, Array], column: Array) -> Array:
    """Return the part of a column (rows, 6) that is orthogonal to the columns ``base`` of a fit."""
    k = len(g.columns)
    cross = np.tensordot(
        g.design[..., :k], search.whiten(column)[search.flights.fit_rows], axes=([0, 1], [0, 1])
    )
    weights = np.linalg.solve(g.blocks.sum(axis=0)[:k, :k] + np.diag(g.precision), cross)
    return column - sum(
        (w * base[c] for c, w in zip(g.columns, weights, strict=True)), np.zeros_like(column)
    )


def _joint_regression(search: Search, g: Gram, columns: Sequence[Array]) -> tuple[float, Array]:
    """Return the deviance that columns (rows, 6) explain together on left-out blocks, and their
    best sum (rows, 6).

    A ridge keeps each small: many columns fitted to noise would cost more than an effect is worth.
    """
    x = search.whiten(np.stack(columns, axis=2))[search.flights.fit_rows]
    k, n = len(g.columns), len(g.columns) + len(columns)
    design = np.concatenate([g.design[..., :k], x, g.design[..., -1:]], axis=2)
    parts = (part.reshape(-1, n + 1) for part in np.split(design, g.begins[1:]))
    blocks = np.array([part.T @ part for part in parts])
    total = blocks.sum(axis=0)
    ridge = np.concatenate(
        [
            g.precision,
            np.full(len(columns), STRUCTURE.ridge * np.trace(total[k:n, k:n]) / len(columns)),
        ]
    )

    def error(size: int) -> float:
        rest = total - blocks
        weights = np.linalg.solve(
            rest[:, :size, :size] + np.diag(ridge[:size]), rest[:, :size, -1:]
        )[..., 0]
        square = np.einsum("bi,bij,bj->", weights, blocks[:, :size, :size], weights)
        return float(total[-1, -1] - 2.0 * np.sum(weights * blocks[:, :size, -1]) + square)

    weights = np.linalg.solve(total[:n, :n] + np.diag(ridge), total[:n, -1])[k:]
    return error(k) - error(n), np.tensordot(np.stack(columns, axis=2), weights, axes=(2, 0))


def _gains(search: Search, g: Gram, columns: Array) -> tuple[Array, Array]:
    """Return the deviance that each of more columns (rows, 6, c) explains alone on left-out blocks,
    and its spread over the blocks.
    """
    x = search.whiten(columns)[search.flights.fit_rows]
    k = len(g.columns)
    parts = zip(np.split(x, g.begins[1:]), np.split(g.design, g.begins[1:]), strict=True)
    cross = np.array(
        [np.tensordot(a, b, axes=([0, 1], [0, 1])) for a, b in parts]
    )  # (blocks, c, k + 1)
    own = np.add.reduceat(np.einsum("nic,nic->nc", x, x), g.begins)  # (blocks, c)
    rest = g.blocks.sum(axis=0) - g.blocks
    rest_cross, rest_own = cross.sum(axis=0) - cross, own.sum(axis=0) - own
    # each column without its part in the base's columns, and the base's own change, both fitted
    # without the block
    normal = rest[:, :k, :k] + np.diag(g.precision)
    weights = np.linalg.solve(normal, np.swapaxes(rest_cross[..., :k], 1, 2))  # (blocks, k, c)
    change = np.linalg.solve(normal, rest[:, :k, -1:])  # (blocks, k, 1)
    left = rest_own - np.einsum("bkc,bck->bc", weights, rest_cross[..., :k])
    slope = (rest_cross[..., -1] - np.einsum("bkc,bk->bc", weights, rest[:, :k, -1])) / np.maximum(
        left, 1e-12
    )
    inner = g.blocks[:, :k, :k] @ weights  # (blocks, k, c)
    size = (
        own
        - 2.0 * np.einsum("bkc,bck->bc", weights, cross[..., :k])
        + np.einsum("bkc,bkc->bc", weights, inner)
    )
    part = (
        cross[..., -1]
        - np.einsum("bkc,bk->bc", weights, g.blocks[:, :k, -1])
        - np.einsum("bk,bck->bc", change[..., 0], cross[..., :k])
        + np.einsum("bk,bkc->bc", change[..., 0], inner)
    )
    gains = np.where(left > 1e-9 * own.sum(axis=0), slope * (2.0 * part - slope * size), 0.0)
    return gains.sum(axis=0), gains.sum(axis=0) / np.maximum(
        np.sqrt(np.sum(gains * gains, axis=0)), 1e-30
    )
