"""Whether the coefficients of a named effect are plausible.

An effect that stands for another one is often fitted at a bound: a dry friction, named a drag,
needs a quadratic part below zero. A true coefficient of zero is at a bound too, but its best fit is
not far outside.
"""

from dataclasses import dataclass

import numpy as np

from .regression import CENTRAL, DRAG_EFFECTS, typical_size
from .search import FittedEffects, Search


@dataclass(frozen=True)
class RangeSettings:
    """From which coefficients on, a named effect is doubtful."""

    # standard deviations beyond a bound; those of true effects are within 2
    most_excess_in_std: float = 3.5
    # share of the effect's own size by which it must exceed a bound: effect models are true to that
    least_excess_share: float = 0.05
    most_typical_sizes: float = 10.0
    # share of the damping about z that must act about x and y: rotors at the arms, which climb and
    # sink, damp these axes more
    least_share_of_yaw_damping: float = 0.3
    # typical sizes of a wind's own drag: true winds had 0.98 to 1.3, tilted frames 0.01 to 0.04
    least_wind_drag: float = 0.1
    # share of a body's drag along its most exposed axis, that another axis must have: true ones, as
    # found on six seeds, had 0.78 and more, RotorPy's 0.34 and more, and what was named body_drag
    # where the library lacked the rotors' inflow 0.00 to 0.02
    least_share_of_largest_drag: float = 0.15
    significance: float = 2.0  # standard deviations


RANGES = RangeSettings()
# effects of which any size is plausible
ANY_SIZE_EFFECTS = frozenset(
    {"mass", "thrust_scale", "com_offset", "constant_force", "constant_torque"}
)


def implausible_coefficients(search: Search, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which coefficients would leave their range, or are implausible for
    their effect.
    """
    vehicle = search.flights.vehicle
    found = []
    size = {
        effect: max(
            (
                abs(v) / typical_size((effect, k), vehicle)
                for k, v in fit.setting[effect].items()
                if k != CENTRAL
            ),
            default=0.0,
        )
        for effect in fit.effects
    }
    for effect in fit.effects:
        if size[effect] > RANGES.most_typical_sizes and effect not in ANY_SIZE_EFFECTS:
            found.append(
                f"{effect} is {size[effect]:.0f} times its typical size: another effect may be the "
                "cause"
            )
    wind = fit.setting.get("wind", {})
    named = {*fit.effects, *(e.name for e in vehicle.effects)}
    if (
        wind
        and not DRAG_EFFECTS & named
        and wind["cd"] < RANGES.least_wind_drag * typical_size(("wind", "cd"), vehicle)
    ):  # drags feel a wind too
        found.append(
            "wind acts on hardly any drag, like a constant force: another effect may be the cause"
        )
    damping = fit.setting.get("rate_damping", {})
    if (
        damping
        and 0.5 * (damping["dx"] + damping["dy"])
        < RANGES.least_share_of_yaw_damping * damping["dz"]
    ):
        found.append(
            "rate_damping acts about z alone, but rotors damp the other axes more: another effect "
            "may be the cause"
        )
    if "body_drag" in fit.effects and _leaves_out_an_axis(search, fit):
        found.append(
            "body_drag acts along some axes alone, but air drags a body along every axis: another "
            "effect may be the cause"
        )
    g = search.gram_at(fit)
    total, k = g.blocks.sum(axis=0), len(g.columns)
    normal = total[:k, :k] + np.diag(g.precision)
    change = np.linalg.solve(normal, total[:k, -1] - g.precision * g.value)
    std = np.sqrt(np.diag(np.linalg.inv(normal)))
    beyond: dict[str, list[str]] = {}
    for (effect, name), d, s, low, high in zip(
        g.columns, change, std, g.lower, g.upper, strict=True
    ):
        least = (
            RANGES.least_excess_share
            * typical_size((effect, name), vehicle)
            * (1.0 if name == CENTRAL else size.get(effect, 0.0))
        )
        if (
            effect
            and ((low >= 0.0 and d < 0.0) or (high <= 0.0 and d > 0.0))
            and abs(d) > max(RANGES.most_excess_in_std * s, least)
        ):
            beyond.setdefault(effect, []).append(name)
    found += [
        f"{effect}: the best fit of {', '.join(names)} lies outside the allowed range: another "
        "effect may be the cause"
        for effect, names in beyond.items()
    ]
    return found


def _leaves_out_an_axis(search: Search, fit: FittedEffects) -> bool:
    """Return whether a named body_drag, at the flights' RMS speed, is significantly small along one
    axis beside another.
    """
    velocity = np.concatenate([p.signals.velocity[p.rows] for p in search.flights.pieces({})])
    speed = float(np.sqrt(np.mean(np.sum(np.square(velocity), axis=1))))
    drag = fit.setting["body_drag"]
    size = [drag.get(f"d{axis}", 0.0) + speed * drag.get(f"c{axis}", 0.0) for axis in "xyz"]
    std = [
        np.hypot(
            fit.std.get(("body_drag", f"d{axis}"), 0.0),
            speed * fit.std.get(("body_drag", f"c{axis}"), 0.0),
        )
        for axis in "xyz"
    ]
    return any(
        one + RANGES.significance * s < RANGES.least_share_of_largest_drag * max(size)
        for one, s in zip(size, std, strict=True)
    )
