"""Which effects no flight tells apart, and how counts are told on pages."""

from collections.abc import Mapping, Sequence

from scipy.stats import binomtest, mannwhitneyu

# Effects that leave the very log that another one leaves, whatever is flown. A latency is a
# positive clock offset. A thrust scale is a rotor efficiency with four equal numbers. A turned
# world frame turns all forces but the assumed weight, which leaves a constant horizontal force.
EQUIVALENTS: Mapping[str, tuple[str, ...]] = {
    "latency": ("clock_offset",),
    "clock_offset": ("latency",),
    "thrust_scale": ("rotor_efficiency",),
    "world_tilt": ("constant_force",),
}
# Effects that leave the log that this one leaves with another inertia, or at a bound: a load on a
# cable of no length is a mass. Where this one is left out of the library, they are too
STAND_INS: Mapping[str, tuple[str, ...]] = {
    "mass": ("thrust_scale", "rotor_efficiency", "slung_payload"),
    "thrust_scale": ("rotor_efficiency", "mass", "slung_payload"),
}


def share(count: int, whole: int) -> str:
    """Return a count of a whole and its 95 % interval (Wilson) in per cent."""
    if not whole:
        return "–"
    low, high = binomtest(count, whole).proportion_ci(method="wilson")
    return f"{count} of {whole} ({100 * low:.0f}–{100 * high:.0f} %)"


def area_under_curve(strange: Sequence[float], known: Sequence[float]) -> str:
    """Return how often a number of ``strange`` is above one of ``known``, with both counts."""
    if not strange or not known:
        return "–"
    area = float(mannwhitneyu(strange, known).statistic) / (len(strange) * len(known))
    return f"{area:.3f} ({len(strange)} against {len(known)})"
