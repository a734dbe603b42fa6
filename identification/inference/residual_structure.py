"""Whether the residual after all named effects still has structure, so that a name may stand for
another effect.

A library that lacks the true effect explains it by a similar one, down to the noise floor. Small
signs show it: candidate regressors still explain part of the residual; the coefficient of the named
effect changes with speed, height, load or time, or from block to block; or the innovations confirm
an effect of which the residual shows too little. Each column is tried alone, on blocks that are
left out in turn.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..findings import STRUCTURE_TESTS, Structure
from .candidate_regressors import (
    explanatory_variables,
    general_regressors,
    resonant_regressors,
    standardised,
)
from .gram_matrix import Gram
from .innovations import Innovations, confirms_addition
from .regression import (
    REGRESSION,
    Column,
    Flights,
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
    # gain of a candidate regressor over the root of the blocks' summed squares: an effect acts
    # again and again, a transient disturbance once
    least_spread: float = 1.5
    # times the least reduction, from which the least spread over blocks is smaller: an effect that
    # acts in one part of a flight, but strongly
    large_reduction_ratio: float = 3.0
    least_spread_of_large: float = 1.0
    # factor on the least reduction where rotor speeds hardly leave their rounding steps
    rounded_rotor_factor: float = 4.0
    batch: int = 24  # columns at a time
    # standard deviations beyond chance, and relative standard deviation of a coefficient from block
    # to block; true effects have at most 3 of the first
    least_scatter_significance: float = 5.0
    least_scatter: float = 0.1
    # deviance of an effect in the residual, and in the innovations, that is too much for no name
    least_residual_hint: float = 10.0
    least_innovation_hint: float = 50.0
    most_signs: int = 12  # reported, the strongest first
    most_confirmations: int = 36  # columns asked of the innovations, which takes time


STRUCTURE = StructureSettings()
REGRESSOR, VARYING, INNOVATIONS = STRUCTURE_TESTS


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
    words: list[tuple[str, str, str]] = []  # test, where, and kind of test
    columns: list[Array] = []
    named: list[float] = []  # deviance of the effects whose model error a column may be
    asked = [general_regressors, resonant_regressors]
    for channel_words, drive, column in itertools.chain.from_iterable(
        ask(flights, fit.setting) for ask in asked
    ):
        words.append(("a candidate regressor", f"{channel_words} with {drive}", REGRESSOR))
        columns.append(column)
        named.append(every)
    known = standardised(explanatory_variables(flights, fit.setting))
    shares = {e: _explained_part(flights, fit, e, residual) for e in fit.effects}
    for effect, share in shares.items():
        for name, x in known.items():
            test = f"{effect}'s coefficient is not constant"
            words.append((test, f"it changes with {name}", VARYING))
            columns.append(share * x[:, None])
        named += [search.deviance_of(share)] * (len(columns) - len(named))
    rough = 1.0 if flights.rotor_speeds_vary else STRUCTURE.rounded_rotor_factor
    least_of_all = max(
        STRUCTURE.least_deviance_reduction * unit, STRUCTURE.least_share_of_residual * error
    )
    least = rough * np.maximum(least_of_all, STRUCTURE.least_share_of_named * np.array(named))
    found = []
    for at in range(0, len(columns), STRUCTURE.batch):
        batch = columns[at : at + STRUCTURE.batch]
        gains, spreads = _gains(search, regression, np.stack(batch, axis=2))
        for i, (column, gain, spread) in enumerate(zip(batch, gains, spreads, strict=True), at):
            if gain > least[i] and spread >= (
                STRUCTURE.least_spread
                if gain < STRUCTURE.large_reduction_ratio * least[i]
                else STRUCTURE.least_spread_of_large
            ):
                found.append((Structure(*words[i][:2], float(gain) / error, words[i][2]), column))
    found.sort(key=lambda x: -x[0].gain)
    block_signs = list(varying_coefficients(search, shares, regression))
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

    Without it a failing cell is a sure thrust, and a drifting torque a constant one: two of 340
    flights with a wrong name.
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
                VARYING,
            )


def innovation_hints(search: Search, fit: FittedEffects) -> Iterator[Structure]:
    """Yield a sign for each effect that the innovations confirm and of which the residual shows too
    little for a name.

    Args:
        search: that found the effects.
        fit: the effects.

    The residual ends at 5 Hz, where an inertia only begins to show; innovations have all
    frequencies. On 129 flights that were diagnosed rightly no other effect of a tenth of its
    typical size had a log-likelihood ratio above 41 there. Of 340 flights with a wrong name it
    alone doubts two.
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
                    INNOVATIONS,
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
