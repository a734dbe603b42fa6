"""A diagnosis in words and rounded numbers, as its report gives them to a reader."""

import math
from collections.abc import Iterable, Iterator, Sequence

from ...dynamics import effects as library
from ..findings import CHANNELS, Diagnosis, NamedEffect

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MISSING = "–"
SPACE = "\N{NO-BREAK SPACE}"
_CERTAIN = 0.001  # probability; closer to 0 or 1 no digit is meant
_TELLING = 1.3  # times the floor: least error in the first sentence
_LIKELIER = 0.5  # probability of a cause outside the library, from which this comes first
_MILLI = 0.8  # N or Nm, below which an error is in thousandths
_WARNING = "warning: "  # marks a note on a doubtful log


def rounded(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits and no exponent; a dash if not finite."""
    if not math.isfinite(value):
        return MISSING
    value = float(f"{value:.{digits - 1}e}")
    decimals = digits - 1 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(decimals, 0)}f}".replace("-", "−")


def with_std(value: float, std: float) -> str:
    """Return ``value ± std``: the deviation with two significant digits, the value as precise, one
    power of ten for both.
    """
    if not math.isfinite(value):
        return MISSING
    std = std if math.isfinite(std) else 0.0
    size = max(abs(value), std)
    power = math.floor(math.log10(size)) if size else 0
    power = 0 if -3 <= power < 4 else power
    scaled = value / 10.0**power
    text = rounded(scaled)
    if std > 0.0:
        spread = float(f"{std:.1e}") / 10.0**power
        decimals = min(max(1 - math.floor(math.log10(spread)), 0), 9)
        text = f"{scaled:.{decimals}f} ± {spread:.{decimals}f}".replace("-", "−")
        text = f"({text})" if power else text
    return f"{text} × 10{str(power).translate(_SUPERSCRIPT)}" if power else text


def scale_of(values: Iterable[float], unit: str, least: float = 0.1) -> tuple[float, str]:
    """Return the common factor and unit, plain or below ``least`` milli, for compared numbers (in
    ``unit``).
    """
    largest = max((abs(v) for v in values if math.isfinite(v)), default=math.inf)
    return (1e3, f"m{unit}") if largest < least else (1.0, unit)


def in_words(names: Sequence[str], last: str = "and") -> str:
    """Return ``a, b and c``."""
    *first, end = names or [""]
    return f"{', '.join(first)} {last} {end}" if first else end


def in_unit(value: float, unit: str) -> str:
    """Return a number with its unit, plain or milli."""
    factor, unit = scale_of([value], unit)
    return f"{rounded(factor * value, 2)}{SPACE}{unit}"


def percent(share: float) -> str:
    """Return a share in per cent, with a digit behind the point below 10 %."""
    if not math.isfinite(share):
        return MISSING
    decimals = 1 if 0.0005 <= abs(share) < 0.0995 else 0
    return f"{100.0 * share:z.{decimals}f}{SPACE}%".replace("-", "−")


def chance(probability: float) -> str:
    """Return a probability in per cent; close to 0 or 1, a bound."""
    if not _CERTAIN < probability < 1.0 - _CERTAIN:
        return f"above 99.9{SPACE}%" if probability > 0.5 else f"below 0.1{SPACE}%"
    return percent(probability)


def duration(seconds: float) -> str:
    """Return a length of time in minutes and seconds."""
    if seconds < 99.5:
        return f"{seconds:.3g}{SPACE}s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}{SPACE}min" + (f" {rest}{SPACE}s" if rest else "")


def effect_summary(name: str) -> str:
    """Return the library's sentence on an effect, empty for an unknown one."""
    if name not in library.names():
        return ""
    return " ".join(library.model_in_words(name).split("\n\n")[0].split()).replace("``", "")


def coefficient_meaning(effect: str, coefficient: str) -> str:
    """Return the meaning of a coefficient in the library, empty for an unknown one."""
    known = library.get(effect).coefficients if effect in library.names() else ()
    return next((c.meaning for c in known if c.name == coefficient), "")


def tried(diagnosis: Diagnosis) -> str:
    """Return the extent of the tried effects, in words."""
    return "that these logs can show" if diagnosis.needs_pose else "in the library"


def is_outside(diagnosis: Diagnosis) -> bool:
    """Return whether a cause outside the library is likelier than none."""
    return diagnosis.probabilities.unknown > _LIKELIER


def without_warning(text: str) -> str:
    """Return a note without its log's name and its mark of a warning, if it has one."""
    return text.rpartition(_WARNING)[2]


def by_energy(diagnosis: Diagnosis) -> list[NamedEffect]:
    """Return the named effects by their share of the residual's energy, the largest first."""
    return sorted(diagnosis.effects, key=lambda e: -e.evidence.get("energy_explained", 0.0))


def doubts(diagnosis: Diagnosis) -> list[str]:
    """Return the reasons to doubt the logs, and then the names."""
    doubted = (
        text
        for text in diagnosis.notes
        if _WARNING in text or any(text in some for some in diagnosis.doubts.values())
    )
    return sorted(doubted, key=lambda text: _WARNING not in text)


def error_amounts(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield the error on held-out data in words: force and torque well above the noise floor."""
    before, after = diagnosis.before, diagnosis.after
    rows = (
        ("force", before.force_rms, after.force_rms, diagnosis.floor_force_rms, "N"),
        ("torque", before.torque_rms, after.torque_rms, diagnosis.floor_torque_rms, "Nm"),
    )
    known = [row for row in rows if math.isfinite(row[1] + row[2])]
    if not known:
        yield "held-out error: not known"
    for what, old, new, floor, unit in [x for x in known if x[1] > _TELLING * x[3]] or known[:1]:
        factor, unit = scale_of((old, new, floor), unit, _MILLI)
        start, end, least = (f"{rounded(factor * x, 2)}{SPACE}{unit}" for x in (old, new, floor))
        change = f"{start} before, {end} after" if diagnosis.effects and start != end else start
        bound = "not known, at least " if diagnosis.floor_is_bound else ""
        noise = f" (noise floor {bound}{least})" if math.isfinite(floor) else ""
        yield f"held-out {what} error: {change}{noise}"


def error_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return the error on held-out data, before and after, as sentences."""
    return [f"H{text[1:]}." for text in error_amounts(diagnosis)]


def remainder_sentence(diagnosis: Diagnosis) -> str:
    """Return the sentence on the residual."""
    if diagnosis.remainder == "none":
        return f"The residual is at the sensors' noise floor{_disturbances(diagnosis)}."
    if diagnosis.remainder == "random":
        if diagnosis.pushes:
            return (
                "The residual holds transient disturbances; the clearest is "
                f"{disturbance_at(diagnosis)}. No test found other structure in it."
            )
        return (
            f"The residual looks random, as turbulence does{_disturbances(diagnosis)}: "
            "no test found structure in it."
        )
    strongest = "".join(
        f"; the strongest is in {found.where} ({percent(found.gain)} of the residual)"
        for found in diagnosis.structure[:1]
    )
    return f"The residual has structure that no effect {tried(diagnosis)} explains{strongest}."


def _disturbances(diagnosis: Diagnosis) -> str:
    """Return the strongest random disturbances, of a force and of a torque, as an insertion."""
    stated = []
    for unit, channels in (("N", CHANNELS[:3]), ("Nm", CHANNELS[3:])):
        own = [gusts for gusts in diagnosis.gusts if gusts.channel in channels]
        if own:
            largest = max(own, key=lambda gusts: gusts.rms)
            stated.append(
                f"{in_unit(largest.rms, unit)} rms "
                f"(correlation time {rounded(largest.time, 2)}{SPACE}s)"
            )
    return f", with disturbances of up to {in_words(stated)}" if stated else ""


def disturbance_at(diagnosis: Diagnosis) -> str:
    """Return the size and time of the clearest transient disturbance."""
    largest = diagnosis.pushes[0]
    size = in_unit(largest.peak, "Nm" if largest.channel.startswith("tau") else "N")
    where = f" of {largest.log}" if len(diagnosis.logs) + len(diagnosis.test_logs) > 1 else ""
    return f"{size} in {largest.channel} at {rounded(largest.t)}{SPACE}s{where}"


def name_in_words(effect: NamedEffect) -> str:
    """Return an effect's name with its alternatives, and a mark of a tentative one."""
    others = in_words(effect.indistinguishable_from, "or")
    tentative = " (tentative)" if effect.tentative else ""
    return f"{effect.name}{f' (or {others})' if others else ''}{tentative}"


def held_out_sum(diagnosis: Diagnosis) -> str:
    """Return how many blocks were held out, and how long they are together."""
    count = len(diagnosis.held_out_segments)
    total = sum(end - start for _, start, end in diagnosis.held_out_segments)
    return f"{count} {'block' if count == 1 else 'blocks'}, {duration(total)}"


def next_step(diagnosis: Diagnosis) -> str:
    """Return the one thing to do next."""
    if diagnosis.verdict in ("explained", "nothing to explain"):
        use = (
            "Use vehicle.yaml, which holds the named effects, in place of the declared vehicle"
            if diagnosis.effects
            else "Keep the model as it is"
        )
        return f"{use}, and confirm it on another flight (--test)."
    if diagnosis.advice:
        return diagnosis.advice[0]
    better = diagnosis.effects and not is_outside(diagnosis)
    use = "Use vehicle.yaml, which holds the named effects. " if better else ""
    return f"{use}To see whether the rest is wind, fly again in still air."
