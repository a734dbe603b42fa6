"""Whether what is left after all named effects still has a law in it, and so a name may be another
effect's.

A library that lacks the true effect explains it by a neighbour, down to the floor of the residual.
What gives the neighbour away is small: something systematic is left over (columns of a general
dictionary), or its own coefficient would rather change with speed, height, load, time or frequency,
or its force, in one channel, would rather be larger than in another. Each column is tried alone, on
blocks that are left out in turn.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ..findings import CHANNELS, Structure
from ..motion.smoothing import CUTOFFS, low_pass
from .candidate_regressors import dictionary, drag_by_place, drags, drives, places, scaled, swings
from .gram_matrix import Gram
from .innovations import Innovations, adds
from .regression import (
    CENTRAL,
    DRAG_EFFECTS,
    LATE_ROTOR_EFFECTS,
    REGRESSION,
    Column,
    Flights,
    Setting,
)
from .search import SEARCH, Fit, Search

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
    # deviance of one question, whether thrust bends: 36 true thrust_curvatures had up to 4, rotors
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
# effects of what is bolted on: it moves along, however fast
RIGID_EFFECTS = frozenset({"mass", "inertia", "com_offset", "marker_offset"})


def structure(search: Search, fit: Fit) -> tuple[list[Structure], bool]:
    """Return the strongest signs of a law in what a fit leaves, the first first, and whether it
    looks as if there were any.

    What looks like a law and is not confirmed by the innovations may be the flight loop's answer to
    gusts.
    """
    flights = search.flights
    regression = search.at(fit)
    error = regression.error(np.arange(len(regression.columns)))
    unit = max(
        1.0, error / regression.design[..., 0].size
    )  # of chance, where gusts are not what they are taken to be
    residual = flights.residual(fit.setting)
    base = flights.columns(fit.setting, regression.columns, 0.1)
    every = search.whitened_energy(flights.residual(fit.without(*fit.effects).setting) - residual)
    words: list[tuple[str, str]] = []
    columns: list[Array] = []
    named: list[float] = []  # energy of what a column may be an untruth of
    asked = [dictionary] if flights.commanded else [dictionary, places, drags, swings]
    for channel_words, drive, column in itertools.chain.from_iterable(
        ask(flights, fit.setting) for ask in asked
    ):
        words.append(("a general dictionary", f"{channel_words} with {drive}"))
        columns.append(column)
        named.append(every)
    known = scaled(drives(flights, fit.setting))
    # what is known from elsewhere was not fitted to these forces
    shares = {e: _share(flights, fit, e, residual) for e in fit.effects if not search.held(e)}
    for effect, share in shares.items():
        for name, x in known.items():
            words.append((f"{effect}'s coefficient is not constant", f"it changes with {name}"))
            columns.append(share * x[:, None])
        rotorwise = any(
            c.name == CENTRAL for c in get(effect).coefficients
        )  # whose moment is free as it is
        for channel in range(3 if rotorwise else 6):
            words.append(
                (f"{effect}'s parts do not fit each other", f"{CHANNELS[channel]} differs")
            )
            columns.append(np.zeros_like(share))
            columns[-1][:, channel] = share[:, channel]
        named += [search.whitened_energy(share)] * (len(columns) - len(named))
    rough = 1.0 if flights.lively else STRUCTURE.rounded_rotor_factor
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
        together, column = _together(search, regression, group)
        if together > rough * max(least_of_all, STRUCTURE.least_share_of_named * every):
            where = "a drag with place and heading together"
            found.append((Structure("a general dictionary", where, together / error), column))
    found.sort(key=lambda x: -x[0].gain)
    if flights.commanded:
        return [sign for sign, _ in found[: STRUCTURE.most_signs]], bool(found)
    wandering = [
        *unsteady(search, shares, regression),
        *other_powers(search, shares, regression, base),
        *kinked(search, fit, regression, base),
        *loose(search, shares, regression, base),
    ]
    if not found:
        signs = wandering or list(overlooked(search, fit))
        return signs, bool(signs)
    innovations = Innovations(flights, fit.setting)
    laws = (
        sign
        for sign, column in found[: STRUCTURE.most_confirmations]
        if innovations.confirm_column(_added(search, regression, base, column))
    )
    return [*wandering, *itertools.islice(laws, STRUCTURE.most_signs)], True


def unsteady(search: Search, shares: Mapping[str, Array], regression: Gram) -> Iterator[Structure]:
    """Yield a sign for each effect that changes from one block of flight to the next by more than
    chance has it.

    Args:
        search: that found the effects.
        shares: what each explains (rows, 6).
        regression: on the columns of the fit.

    A law is the same all along; what comes and goes, and has a mean, looks like one. Each block has
    a multiple of the effect of its own; by how much these scatter is the moment estimate of a
    random coefficient's variance (T. S. Breusch and A. R. Pagan, Econometrica 47 (1979), 1287-1294,
    have the test).
    """
    whole = regression.blocks[:, -1, -1].sum()
    unit = max(1.0, float(whole) / regression.design[..., 0].size)
    for effect, share in shares.items():
        x = search.whiten(share)[search.flights.fit]
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
                f"it changes by {scatter:.0%} from one {REGRESSION.block:.0f} s of flight to the "
                "next"
            )
            yield Structure(
                f"{effect}'s coefficient is not constant",
                words,
                float(np.sum(slope**2 / np.maximum(size, 1e-30)) / max(whole, 1e-30)),
            )


def other_powers(
    search: Search, shares: Mapping[str, Array], regression: Gram, base: Mapping[Column, Array]
) -> Iterator[Structure]:
    """Yield a sign for each named drag whose force would rather grow with another power of speed.

    Args:
        search: that found the effects.
        shares: what each explains (rows, 6).
        regression: on the columns of the fit.
        base: these columns (rows, 6) each.

    A question of its own, in all rows together: a flight at one speed has another one only as it
    begins.
    """
    flights = search.flights
    whole = regression.blocks[:, -1, -1].sum()
    for effect in filter(DRAG_EFFECTS.__contains__, shares):
        speed = np.concatenate(
            [np.linalg.norm(p.signals.velocity[p.rows], axis=1) for p in flights.pieces({})]
        )
        # what slow flight tells, and what quick flight tells
        asked = (
            _beside(search, regression, base, shares[effect] * x[:, None])
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


def kinked(
    search: Search, fit: Fit, regression: Gram, base: Mapping[Column, Array]
) -> Iterator[Structure]:
    """Yield a sign where rotors would rather deliver less, or more, beyond some thrust.

    Args:
        search: that found the effects.
        fit: the effects.
        regression: on the columns of the fit.
        base: these columns (rows, 6) each.

    A rotor that stalls beyond some thrust does so in a few moments of a flight, which are too few
    blocks for a law, and a thrust_curvature takes it up in good part: a question of its own, in all
    rows together. Where one is named it is asked, too, whether thrust would rather bend at hover
    than all along, and nothing needs to be borne out.
    """
    flights, bent = search.flights, "thrust_curvature" in fit.effects
    if not flights.lively:
        return
    asked = [
        (
            f"what rotors deliver beyond {share:.1f} times the thrust of hover",
            _bent(flights, fit.setting, share, 0.0),
        )
        for share in STRUCTURE.thrust_bends
    ]
    if bent:
        asked.append(
            (
                "thrust, which bends at one point rather than all along",
                _bent(flights, fit.setting, 1.0, -1.0),
            )
        )
    gains = [_beside(search, regression, base, column)[1] for _, column in asked]
    best = int(np.argmax(gains))
    where, column = asked[best]
    stalls = gains[best] > STRUCTURE.least_reduction_of_stall and Innovations(
        flights, fit.setting
    ).confirm_column(_added(search, regression, base, column))
    if stalls or (bent and gains[best] > STRUCTURE.least_reduction_of_bend):
        yield Structure(
            "a general dictionary",
            where,
            gains[best] / max(float(regression.blocks[:, -1, -1].sum()), 1e-30),
        )


def _bent(flights: Flights, setting: Setting, share: float, below: float) -> Array:
    """Return what rotors deliver (rows, 6) beyond so many times their share of the weight, and
    ``below`` times what below.
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


def loose(
    search: Search, shares: Mapping[str, Array], regression: Gram, base: Mapping[Column, Array]
) -> Iterator[Structure]:
    """Yield a sign for each named mass, inertia or place of one that is another one for slow motion
    than for quick motion.

    Args:
        search: that found the effects.
        shares: what each explains (rows, 6).
        regression: on the columns of the fit.
        base: these columns (rows, 6) each.

    What is on a soft mount follows slow motion as if it were bolted on, and quick motion hardly:
    below its own frequency it is the larger one.
    """
    flights = search.flights
    whole = float(regression.blocks[:, -1, -1].sum())
    least = STRUCTURE.least_deviance_reduction * max(1.0, whole / regression.design[..., 0].size)
    for effect in filter(RIGID_EFFECTS.__contains__, shares):
        pieces = np.split(shares[effect], np.flatnonzero(flights.start)[1:])
        slow = np.concatenate(
            [low_pass(piece, CUTOFFS.slow_motion_hz, flights.period) for piece in pieces]
        )
        more, gain = _beside(search, regression, base, slow)
        if more > 0.0 and gain > max(
            least, STRUCTURE.least_share_of_loose_mount * search.whitened_energy(shares[effect])
        ):
            yield Structure(
                f"{effect}'s coefficient is not constant",
                f"it changes below {CUTOFFS.slow_motion_hz:.0f} Hz",
                gain / max(whole, 1e-30),
            )


def overlooked(search: Search, fit: Fit) -> Iterator[Structure]:
    """Yield a sign for each effect of which the residual shows too little for a name, and the
    innovations much.

    Args:
        search: that found the effects.
        fit: the effects.

    The residual ends at 5 Hz, where an inertia only begins to show; innovations have all
    frequencies. Beside what was named rightly, or rightly not, on 129 flights no other effect of a
    tenth of its typical size had more than 41 units there.
    """
    regression = search.linearise(fit)
    for gain in search.gains(fit, regression, search.gram(fit, regression)):
        if gain.energy > STRUCTURE.least_residual_hint and gain.size > SEARCH.least_size:
            more = search.refit(gain.fit)
            if adds(search.flights, fit.setting, more.setting, STRUCTURE.least_innovation_hint):
                yield Structure(
                    "innovations show more than the residual", f"of {gain.effect}", gain.share
                )


def _share(flights: Flights, fit: Fit, effect: str, residual: Array) -> Array:
    """Return what an effect explains (rows, 6) of the residual that is left without it.

    What is moved in time differs from what it was by its noise too, which is also in the residual:
    of such an effect it is what a little more of it would change.
    """
    if effect not in LATE_ROTOR_EFFECTS:
        return flights.residual(fit.without(effect).setting) - residual
    own = fit.setting[effect]
    columns = flights.columns(fit.setting, [(effect, name) for name in own], 0.1)
    return sum(
        (value * columns[effect, name] for name, value in own.items()), np.zeros_like(residual)
    )


def _added(search: Search, g: Gram, base: Mapping[Column, Array], column: Array) -> Array:
    """Return what the best multiple of a column (rows, 6) adds to a fit with columns ``base``."""
    alone = _alone(search, g, base, column)
    x = search.whiten(alone)[search.flights.fit]
    return np.asarray(alone * np.sum(x * g.design[..., -1]) / np.sum(x * x))


def _beside(
    search: Search, g: Gram, base: Mapping[Column, Array], column: Array
) -> tuple[float, float]:
    """Return the best multiple of a column (rows, 6) beside the columns ``base`` of a fit, and the
    energy that it explains.
    """
    x = search.whiten(_alone(search, g, base, column))[search.flights.fit]
    slope, size = float(np.sum(x * g.design[..., -1])), max(float(np.sum(x * x)), 1e-30)
    return slope / size, slope**2 / size


def _alone(search: Search, g: Gram, base: Mapping[Column, Array], column: Array) -> Array:
    """Return a column (rows, 6) less what the columns ``base`` of a fit make of it."""
    k = len(g.columns)
    cross = np.tensordot(
        g.design[..., :k], search.whiten(column)[search.flights.fit], axes=([0, 1], [0, 1])
    )
    weights = np.linalg.solve(g.blocks.sum(axis=0)[:k, :k] + np.diag(g.precision), cross)
    return column - sum(
        (w * base[c] for c, w in zip(g.columns, weights, strict=True)), np.zeros_like(column)
    )


def _together(search: Search, g: Gram, columns: Sequence[Array]) -> tuple[float, Array]:
    """Return the energy that columns (rows, 6) explain together on blocks left out, and what of
    them (rows, 6) does it best.

    A ridge keeps each small: what many columns make of noise would cost more than what a law is
    worth.
    """
    x = search.whiten(np.stack(columns, axis=2))[search.flights.fit]
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
    """Return the energy that each of more columns (rows, 6, c) explains alone on blocks left out,
    and how it spreads.
    """
    x = search.whiten(columns)[search.flights.fit]
    k = len(g.columns)
    parts = zip(np.split(x, g.begins[1:]), np.split(g.design, g.begins[1:]), strict=True)
    cross = np.array(
        [np.tensordot(a, b, axes=([0, 1], [0, 1])) for a, b in parts]
    )  # (blocks, c, k + 1)
    own = np.add.reduceat(np.einsum("nic,nic->nc", x, x), g.begins)  # (blocks, c)
    rest = g.blocks.sum(axis=0) - g.blocks
    rest_cross, rest_own = cross.sum(axis=0) - cross, own.sum(axis=0) - own
    # each column less what the base's columns make of it, and the base's own change, fitted without
    # the block
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
