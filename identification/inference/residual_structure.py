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

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ..findings import CHANNELS, Structure
from ..motion.signals import low_pass
from .candidate_regressors import dictionary, drag_by_place, drags, drives, places, scaled, swings
from .gram_matrix import Gram
from .innovations import Innovations, adds
from .regression import BLOCK, CENTRAL, CUTOFF_HZ, DRAGS, LATE, Column, Flights, Setting
from .search import LEAST_SIZE, Fit, Search

Array = NDArray[np.float64]

# whitened energy on blocks left out; where nothing is lacking few flights have a column above 25
LEAST_GAIN = 40.0
LEAST_SHARE = 0.004  # and as a share of the remainder's energy
# and of what the named effects explain: laws, and the plant they act in, are no truer than one per
# cent
LEAST_OF_NAMED = 1e-4
LEAST_SPREAD = (
    1.5  # gain over the root of the blocks' summed squares: a law acts again and again, a push once
)
LEAST_SPREAD_OF_COMMANDS = (
    2.0  # the same of flights known from commands, where nothing is confirmed by innovations
)
LARGE, LEAST_OF_LARGE = (
    3.0,
    1.0,
)  # times the least gain: a law that acts in one part of the flight, but strongly
# of columns that are tried together, as a share of their mean energy; from 0.03 to 0.3 little
# changes
RIDGE = 0.1
ROUGH = (
    4.0  # times the least gain, where turn rates hardly leave the step to which they are rounded
)

_BATCH = 24  # columns at a time
UNSTEADY, LEAST_UNSTEADY = (
    5.0,
    0.1,
)  # standard deviations beyond chance, and of a coefficient: true laws have at most 3
LEAST_OF_POWERS = 7.0  # whitened energy, of one question: 93 true drags had up to 5
# the same of an exponent that is off by half or more; on two flights on a circle, at one speed, a
# third of a friction had 6.4 and 8.1
OFF, LEAST_OF_OFF = 0.5, 4.0
SLOW = 0.05  # m/s, below which speed is noise
KINKS = 0.9, 1.0, 1.1, 1.2, 1.3  # of the thrust of hover
# whitened energy, of one question: 36 true curvatures had up to 4, rotors that stall 29 to 680; and
# where no curvature is named, 93 flights without a kink had up to 17 that innovations bore out, a
# rotor that stalls 56
LEAST_OF_KINKS, LEAST_OF_STALLS = 12.0, 25.0
RIGID = frozenset(
    {"mass", "inertia", "com_offset", "marker_offset"}
)  # what is bolted on moves along, however fast
SLOW_HZ = 3.0  # of the 5 that the residual has
# of what it explains: beyond LEAST_GAIN true ones had up to 0.007 (one 0.3), loose cameras 0.04 to
# 2.3
LEAST_OF_LOOSE = 0.02
HINT, BORNE_OUT = (
    10.0,
    50.0,
)  # energy of an effect in the residual, and in innovations, that is too much to pass over
MOST = 12  # signs, the strongest
_ASKED = 36  # of the innovations, which takes its time


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
    rough = 1.0 if flights.lively else ROUGH
    least_of_all = max(LEAST_GAIN * unit, LEAST_SHARE * error)
    least = rough * np.maximum(least_of_all, LEAST_OF_NAMED * np.array(named))
    steady = LEAST_SPREAD_OF_COMMANDS if flights.commanded else LEAST_SPREAD
    found = []
    for at in range(0, len(columns), _BATCH):
        batch = columns[at : at + _BATCH]
        gains, spreads = _gains(search, regression, np.stack(batch, axis=2))
        for i, (column, gain, spread) in enumerate(zip(batch, gains, spreads, strict=True), at):
            if gain > least[i] and spread >= (
                steady if gain < LARGE * least[i] else LEAST_OF_LARGE
            ):
                found.append((Structure(*words[i], float(gain) / error), column))
    if not flights.commanded and (group := drag_by_place(flights, fit.setting)):
        together, column = _together(search, regression, group)
        if together > rough * max(least_of_all, LEAST_OF_NAMED * every):
            where = "a drag with place and heading together"
            found.append((Structure("a general dictionary", where, together / error), column))
    found.sort(key=lambda x: -x[0].gain)
    if flights.commanded:
        return [sign for sign, _ in found[:MOST]], bool(found)
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
        for sign, column in found[:_ASKED]
        if innovations.confirm_column(_added(search, regression, base, column))
    )
    return [*wandering, *itertools.islice(laws, MOST)], True


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
        if beyond > UNSTEADY * unit * np.sqrt(2.0 * squares) and scatter > LEAST_UNSTEADY:
            words = f"it changes by {scatter:.0%} from one {BLOCK:.0f} s of flight to the next"
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
    for effect in filter(DRAGS.__contains__, shares):
        speed = np.concatenate(
            [np.linalg.norm(p.signals.velocity[p.rows], axis=1) for p in flights.pieces({})]
        )
        # what slow flight tells, and what quick flight tells
        asked = (
            _beside(search, regression, base, shares[effect] * x[:, None])
            for x in (np.log(speed.clip(SLOW)), speed)
        )
        (exponent, slow), (_, quick) = asked
        gain = max(slow, quick)
        if gain > LEAST_OF_POWERS or (slow > LEAST_OF_OFF and abs(exponent) > OFF):
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
        for share in KINKS
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
    stalls = gains[best] > LEAST_OF_STALLS and Innovations(flights, fit.setting).confirm_column(
        _added(search, regression, base, column)
    )
    if stalls or (bent and gains[best] > LEAST_OF_KINKS):
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
                np.concatenate([force, wrench[:, 1:]], axis=1), CUTOFF_HZ, piece.signals.period
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
    least = LEAST_GAIN * max(1.0, whole / regression.design[..., 0].size)
    for effect in filter(RIGID.__contains__, shares):
        pieces = np.split(shares[effect], np.flatnonzero(flights.start)[1:])
        slow = np.concatenate([low_pass(piece, SLOW_HZ, flights.period) for piece in pieces])
        more, gain = _beside(search, regression, base, slow)
        if more > 0.0 and gain > max(
            least, LEAST_OF_LOOSE * search.whitened_energy(shares[effect])
        ):
            yield Structure(
                f"{effect}'s coefficient is not constant",
                f"it changes below {SLOW_HZ:.0f} Hz",
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
        if gain.energy > HINT and gain.size > LEAST_SIZE:
            more = search.refit(gain.fit)
            if adds(search.flights, fit.setting, more.setting, BORNE_OUT):
                yield Structure(
                    "innovations show more than the residual", f"of {gain.effect}", gain.share
                )


def _share(flights: Flights, fit: Fit, effect: str, residual: Array) -> Array:
    """Return what an effect explains (rows, 6) of the residual that is left without it.

    What is moved in time differs from what it was by its noise too, which is also in the residual:
    of such an effect it is what a little more of it would change.
    """
    if effect not in LATE:
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
        [g.precision, np.full(len(columns), RIDGE * np.trace(total[k:n, k:n]) / len(columns))]
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
