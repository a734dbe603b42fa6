"""A diagnosis in words and rounded numbers, as its report gives them to a reader."""

import math
from collections.abc import Iterable, Sequence

from ...dynamics import effects as library
from ..findings import Diagnosis, NamedEffect

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MISSING = "–"
_CERTAIN = 0.001  # probability; closer to 0 or 1 no digit is meant
_LIKELIER = 0.5  # probability of a cause outside the library, from which this comes first
_MUCH = 0.1  # fall of an error as a share, from which the headline states it beside a larger fall
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


def in_unit(value: float, unit: str, digits: int = 2) -> str:
    """Return a number with its unit, plain or milli."""
    factor, unit = scale_of([value], unit)
    return f"{rounded(factor * value, digits)}\N{NO-BREAK SPACE}{unit}"


def percent(share: float) -> str:
    """Return a share in per cent, with a digit behind the point below 10 % and above 99 %."""
    if not math.isfinite(share):
        return MISSING
    near = min(abs(share), 10.0 * abs(1.0 - abs(share)))
    decimals = 1 if 0.0005 <= near < 0.0995 else 0
    return f"{100.0 * share:z.{decimals}f}\N{NO-BREAK SPACE}%".replace("-", "−")


def chance(probability: float) -> str:
    """Return a probability in per cent; close to 0 or 1, a bound."""
    if not _CERTAIN < probability < 1.0 - _CERTAIN:
        return (
            "above 99.9\N{NO-BREAK SPACE}%" if probability > 0.5 else "below 0.1\N{NO-BREAK SPACE}%"
        )
    return percent(probability)


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


def warnings_in(notes: Iterable[str]) -> list[str]:
    """Return the warnings among notes, without their logs' names and mark."""
    return [without_warning(text) for text in notes if _WARNING in text]


def first_doubt(doubts: Sequence[str]) -> list[str]:
    """Return the first sentence of the first doubt, if any."""
    return [f"Doubt: {doubt.split('. ')[0].removesuffix('.')}." for doubt in doubts[:1]]


def energy(effect: NamedEffect) -> float:
    """Return an effect's share of the residual's energy."""
    return effect.evidence.get("energy_explained", 0.0)


def by_energy(diagnosis: Diagnosis) -> list[NamedEffect]:
    """Return the named effects by their energy, the largest first."""
    return sorted(diagnosis.effects, key=energy, reverse=True)


def doubts(diagnosis: Diagnosis) -> list[str]:
    """Return the reasons to doubt the logs, and then the names; a likely cause outside the library
    stands in the headline.
    """
    checks = diagnosis.doubts
    of_names = [text for name in checks if name != "unknown" for text in checks[name]]
    said = [text for text in diagnosis.notes if _WARNING in text or text in of_names]
    return sorted(said, key=lambda text: _WARNING not in text)


def error_table(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """Return the rows of the error table: name, unit, and three rounded numbers (before, after,
    floor).
    """
    floors = {
        "force_rms": ("Force, rms", "N", diagnosis.floor_force_rms),
        "torque_rms": ("Torque, rms", "Nm", diagnosis.floor_torque_rms),
        "rollout_1s_position_rms": ("Position after 1 s of prediction, rms", "m", math.nan),
        "nis_without_wrench_state": ("NIS of a filter without wrench states, mean", "", 6.0),
    }
    table = []
    for name, (what, unit, floor) in floors.items():
        before, after = (getattr(side, name) for side in (diagnosis.before, diagnosis.after))
        factor, unit = scale_of((before, after, floor), unit, _MILLI) if unit else (1.0, "")
        # zero before and after: these logs cannot tell this error
        told = before or after
        old, new, least = (rounded(factor * x) if told else MISSING for x in (before, after, floor))
        least = (least if unit else "6") if told and math.isfinite(floor) else ""
        table.append({"what": what, "unit": unit, "before": old, "after": new, "floor": least})
    return table


def error_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return the known errors of force and torque on held-out data, before and after, as
    sentences.
    """
    return [f"Held-out {text}." for _, text in _errors(diagnosis)]


def error_of_the_effects(diagnosis: Diagnosis) -> list[str]:
    """Return the sentence on the errors lowered by the named effects, the larger fall first; the
    error of largest fall alone where none falls much. Nothing is returned for unknown errors.
    """
    by_fall = sorted(_errors(diagnosis), key=lambda error: -error[0])
    told = [text for fall, text in by_fall if fall > _MUCH] or [text for _, text in by_fall[:1]]
    return [f"Held-out {'; '.join(told)}."] if told else []


def _errors(diagnosis: Diagnosis) -> list[tuple[float, str]]:
    """Return the fall of the known errors of force and torque as a share, and each in words."""
    bound = "at least " if diagnosis.floor_is_bound else ""
    told = []
    for row, name in zip(error_table(diagnosis), ("force_rms", "torque_rms"), strict=False):
        before, after, floor = (
            f"{row[x]}\N{NO-BREAK SPACE}{row['unit']}" for x in ("before", "after", "floor")
        )
        if MISSING not in before + after:
            change, fall = after, 0.0
            if diagnosis.effects:
                change = f"{before} before, {after} after"
                fall = 1.0 - getattr(diagnosis.after, name) / getattr(diagnosis.before, name)
            kind = row["what"].partition(",")[0].lower()
            told.append((fall, f"{kind} error: {change} (noise floor {bound}{floor})"))
    return told


def remainder_sentence(diagnosis: Diagnosis) -> str:
    """Return the sentence on the residual."""
    if diagnosis.remainder == "none":
        return f"The residual is at the sensors' noise floor{disturbances(diagnosis)}."
    if diagnosis.remainder == "structured":
        strongest = "".join(
            f"; the strongest is in {found.where} ({chance(found.gain)} of the residual)"
            for found in diagnosis.structure[:1]
        )
        return f"The residual has structure that no effect {tried(diagnosis)} explains{strongest}."
    told = disturbances(diagnosis)
    if diagnosis.pushes:
        told = f", with transient disturbances, the clearest {disturbance_at(diagnosis)}"
    return f"The residual looks random{told}; no test found structure in it."


def disturbances(diagnosis: Diagnosis) -> str:
    """Return the strongest random disturbances, of a force and of a torque, as an insertion."""
    by_size = sorted(diagnosis.gusts, key=lambda gusts: -gusts.rms)
    stated = [
        f"{in_unit(gusts.rms, unit)} rms "
        f"(correlation time {rounded(gusts.time, 2)}\N{NO-BREAK SPACE}s)"
        for unit in ("N", "Nm")
        for gusts in [x for x in by_size if _unit_of(x.channel) == unit][:1]
    ]
    return f", with gusts of {in_words(stated)}" if stated else ""


def _unit_of(channel: str) -> str:
    return "Nm" if channel.startswith("tau") else "N"


def disturbance_at(diagnosis: Diagnosis) -> str:
    """Return the size and time of the clearest transient disturbance."""
    largest = diagnosis.pushes[0]
    size = in_unit(largest.peak, _unit_of(largest.channel))
    where = f" of {largest.log}" if len(diagnosis.logs) + len(diagnosis.test_logs) > 1 else ""
    return f"{size} in {largest.channel} at {rounded(largest.t)}\N{NO-BREAK SPACE}s{where}"


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
