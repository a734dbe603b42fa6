"""What the outcomes of ``trials`` are worth: one judgement a diagnosis, and the rules that they are
held to.

A name is *confidently wrong* where it stands for no added effect and is not tentative. A diagnosis
is *right* where every added effect has its name and there is no other.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import erf, sqrt
from typing import Any

import numpy as np

from windwrench.identification.search_verdict import SEARCH_VERDICT
from windwrench.studies.scoring import (
    EQUIVALENTS,
    area_under_curve,
    coefficient_errors,
    match,
    share,
    stands_for,
)
from windwrench.studies.trials.held_back_outsiders import UNSEEN

# outcomes of a diagnosis; right with nothing added is nothing named
RIGHT = "right"  # every added effect named, no other, none tentative
RIGHT_TENTATIVE = "right, tentative"  # or structure reported where there is none
PARTIAL = "partial"  # true names only, but not all
TENTATIVE = "tentative"  # other names, or too many, and those marked tentative
UNEXPLAINED = "unexplained"  # nothing named, and an unexplained error reported
SILENT = "silent"  # nothing named, and no error reported
WRONG = "confidently wrong"  # a wrong name that is not marked tentative
FAILED = "failed"  # the diagnosis ended in an error
COEFFICIENT_BAR = 0.05
FLOOR_BAR = 1.2  # times what the sensors leave
ROLLOUT_BARS = {"rotor_drag": 0.25, "mass": 0.25, "inflow_thrust": 0.25, "ground_effect": 0.5}
_ROTORPY = {"rotor_drag": ("kdx", "kdy"), "inflow_thrust": ("kz",), "translational_lift": ("kh",)}


@dataclass(frozen=True)
class Judgement:
    """What one diagnosis of one flight is worth.

    Attributes:
        key: of the trial.
        cause: what was added, in words.
        flight: trajectory and conditions, in words.
        without: effects that were taken out of the library.
        truth: effects that were added.
        outcome: RIGHT, or another of the words above.
        named: with a question mark where tentative, and what flights cannot tell from each.
        exact: right by the very names, not only up to what flights cannot tell.
        classes: all that is named, or that flights cannot tell from a name.
        errors: of coefficients: relative, and in their own standard deviations.
        floor_ratio: largest of force's and torque's residual after, over the noise floor.
        rollout_ratio: one-second prediction error after, over before.
        rollout_of_truth: the same of the true model, on the same blocks.
        gusts: in force, found over flown; NaN in still air.
        probable: whether each name is true whose probability makes the name sure.
        unknown: probability that something outside the library acts.
        gave_away: strongest sign of structure.
        problem: the error's text where the diagnosis failed.
        seconds: that the diagnosis took.
    """

    key: str
    group: str
    cause: str
    size: str
    vehicle: str
    flight: str
    without: tuple[str, ...]
    truth: tuple[str, ...]
    outcome: str
    named: tuple[str, ...]
    exact: bool
    classes: tuple[str, ...]
    all_tentative: bool
    errors: Mapping[str, tuple[float, float]]
    verdict: str
    floor_ratio: float
    rollout_ratio: float
    rollout_of_truth: float
    gusts: float
    probable: tuple[bool, ...]
    unknown: float
    gave_away: str
    problem: str
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the names are right, with or without a doubt."""
        return self.outcome in (RIGHT, RIGHT_TENTATIVE)


def judge(outcome: Mapping[str, Any]) -> list[Judgement]:
    """Return the judgements of a trial's diagnoses; none where the flight itself failed."""
    if "error" in outcome:
        return []
    return [_judge(outcome, found) for found in outcome["diagnoses"]]


def _judge(outcome: Mapping[str, Any], found: Mapping[str, Any]) -> Judgement:
    trial, flown = outcome["trial"], outcome["flown"]
    truth: Mapping[str, Mapping[str, float]] = flown["truth"]
    effects = found.get("effects", [])
    failed = "error" in found
    wrong = [e["name"] for e in effects if not e["tentative"] and not (stands_for(e) & set(truth))]
    pairs = match(effects, list(truth))
    right = pairs is not None and not flown["outsider"]
    tentative = any(e["tentative"] for e in effects) or (
        not effects and found.get("remainder") == "structured"
    )
    if failed:
        verdict = FAILED
    elif right:
        verdict = RIGHT_TENTATIVE if tentative else RIGHT
    elif wrong:
        verdict = WRONG
    elif effects:
        verdict = TENTATIVE if tentative else PARTIAL
    else:
        verdict = SILENT if found["remainder"] == "none" else UNEXPLAINED
    after, floor = found.get("after", {}), found.get("floor", {})
    behind = set().union(*(stands_for(e) for e in effects))
    size = "" if trial["group"] in ("nothing", "strong turbulence") else f", {trial['size']}"
    structure = found.get("structure", [])
    return Judgement(
        key=outcome["key"],
        group=trial["group"],
        cause=flown["outsider"] or " + ".join(truth) or "nothing",
        size=trial["size"],
        vehicle=trial["vehicle"],
        flight=f"{flown['trajectory']}{size}, noise x{flown['sensor']:g}, turbulence "
        f"x{flown['turbulence']:g}",
        without=tuple(found["without"]),
        truth=tuple(truth),
        outcome=verdict,
        named=tuple(_word(e) for e in effects),
        exact=not failed and {e["name"] for e in effects} == set(truth),
        classes=tuple(sorted(behind)),
        all_tentative=all(e["tentative"] for e in effects),
        errors=coefficient_errors(
            effects, truth, pairs or [(e["name"], e["name"]) for e in effects if e["name"] in truth]
        ),
        verdict=found.get("verdict", ""),
        floor_ratio=max(
            (_ratio(after.get(k), floor.get(k)) for k in ("force_rms", "torque_rms")),
            default=np.nan,
        ),
        rollout_ratio=_ratio(
            after.get("rollout_1s_position_rms"),
            found.get("before", {}).get("rollout_1s_position_rms"),
        ),
        rollout_of_truth=_number(flown.get("rollout_of_truth")),
        gusts=_ratio(float(np.mean(found["gusts"][:3])), flown.get("gusts"))
        if found.get("gusts")
        else np.nan,
        probable=tuple(
            bool(stands_for(e) & set(truth))
            for e in effects
            if (e.get("probability") or 0.0) >= SEARCH_VERDICT.least_sure_probability
        ),
        unknown=_number(found.get("unknown")),
        gave_away=f"{structure[0]['test']}: {structure[0]['where']}" if structure else "",
        problem=found.get("error", ""),
        seconds=found["seconds"],
    )


def _word(effect: Mapping[str, Any]) -> str:
    others = ", ".join(effect["indistinguishable_from"])
    return f"{effect['name']}{'?' if effect['tentative'] else ''}" + (
        f" (or {others})" if others else ""
    )


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _ratio(after: float | None, before: float | None) -> float:
    return float(after / before) if after is not None and before else float("nan")


@dataclass(frozen=True)
class Rule:
    """One line of the table of rules."""

    subject: str
    target: str
    measured: str
    met: bool | None  # None: there was nothing to measure
    count: int  # diagnoses


def rules(judged: Iterable[Judgement]) -> list[Rule]:
    """Return what the judgements say about each rule."""
    every = list(judged)
    full = [j for j in every if not j.without]

    def of(*groups: str) -> list[Judgement]:
        return [j for j in full if j.group in groups]

    typical, third, pairs, presets = of("typical"), of("third"), of("pair"), of("preset")
    nothing, held_back = of("nothing", "strong turbulence"), of("held back")
    outside = [*of("outsider"), *held_back]
    alone = [j for j in typical if j.right]
    right_presets, right_pairs = ([j for j in some if j.right] for some in (presets, pairs))
    known = [j for j in typical + third + presets + nothing if j.right]
    out_of_library = [j for size in ("typical", "small") for j in left_out(every, size)]
    wrong = [j for j in out_of_library if j.outcome == WRONG]
    unseen = [j for j in held_back if j.cause in UNSEEN]
    explained = [j for j in full if j.verdict == "explained"]
    one, same = "1. one effect of typical size: right name, no other", "1. the same"
    third_size = "2. one effect of a third of that size: right name, no other"
    doubtful = (
        "3. outside the library, {}: `unexplained` or `partly explained`, every name tentative"
    )
    within = "1. every coefficient that is not zero within 5 %, where the names are right"
    not_wrong = "5. left out of the library, {}: not confidently wrong, by kind"
    shown = "4. hover: the true effect is named, or indistinguishable from one that is named"
    cannot = (
        "5. of those confidently wrong: flights on which the whole library says that it cannot tell"
    )
    marked = "5. right names, or rightly none, that the search for structure marks tentative"
    unbiased = (
        "1. the same of both, expected of an unbiased fit with the standard deviations that were "
        "reported"
    )
    out = [
        _share(one, typical, _is_right, 0.95),
        _share(
            f"{same} with the presets hummingbird and crazyflie, in part", presets, _is_right, 0.95
        ),
        _coefficients(within, alone),
        _coefficients(f"{same} with the presets", right_presets),
        _unbiased(unbiased, alone + right_presets),
        _share(third_size, third, _is_right, 0.90),
        _share("2. two effects: both right names, no other", pairs, _is_right, 0.90),
        _share("3. no effect: nothing named", nothing, _names_nothing, 1.0),
        *(
            _share(doubtful.format(words), [j for j in outside if j.size == size], doubts, 1.0)
            for size, words in (("typical", "typical size"), ("small", "a third of it"))
        ),
        _share("3. the same, held-back disturbances of both sizes alone", held_back, doubts, 1.0),
        _share("3. the same, the six that no rule has seen alone", unseen, doubts, 1.0),
        _share("4. hover: no name confidently wrong", of("hover"), _not_wrong, 1.0),
        _share(shown, of("hover"), lambda j: set(j.truth) <= set(j.classes), None),
        _by_kind(not_wrong.format("typical size"), left_out(every, "typical"), 0.90),
        _by_kind(not_wrong.format("a third"), left_out(every, "small"), 0.80),
        _share(cannot, wrong, lambda j: undecided(j, full), None),
        _share(marked, known, _is_doubted, 0.03, at_most=True),
        _share(
            "5. right names of two effects that it marks tentative",
            right_pairs,
            _is_doubted,
            0.10,
            at_most=True,
        ),
        _floor(
            "6. residual after, over the noise floor, where the verdict is `explained`", explained
        ),
    ]
    for name, bar in ROLLOUT_BARS.items():
        some = [j for j in typical if j.cause == name and j.exact]
        rule = f"6. one-second prediction error after over before, {name} of typical size"
        if not some:
            out.append(Rule(rule, f"<= {bar:g}", "not named", None, 0))
            continue
        worst = max(some, key=lambda j: j.rollout_ratio)
        met = sum(j.rollout_ratio <= bar for j in some)
        told = f"{worst.rollout_ratio:.2f} at worst, {met} of {len(some)} within; "
        told += f"there the true model comes to {worst.rollout_of_truth:.2f}"
        out.append(Rule(rule, f"<= {bar:g}", told, met == len(some), len(some)))
    foreign = outside + [j for j in out_of_library if j.without]
    inside = [j for j in full if j.group not in ("outsider", "held back")]
    return [
        *out,
        *_rotorpy(of("rotorpy")),
        *_probabilities(inside, foreign),
        _gusts([j for j in full if j.right]),
    ]


def _is_right(j: Judgement) -> bool:
    return j.right


def _is_doubted(j: Judgement) -> bool:
    return j.outcome == RIGHT_TENTATIVE


def _names_nothing(j: Judgement) -> bool:
    return not j.named and j.outcome != FAILED


def doubts(j: Judgement) -> bool:
    """Return whether a diagnosis says that something is left which no effect explains, and is sure
    of no name.
    """
    return j.verdict in ("unexplained", "partly explained") and j.all_tentative


def left_out(judged: Iterable[Judgement], size: str) -> list[Judgement]:
    """Return the diagnoses whose cause was in no way in the library: effects left out, and
    held-back disturbances.
    """
    group = {"typical": "typical", "small": "third"}[size]
    return [
        j
        for j in judged
        if (j.group == group and set(j.without) == {*j.truth, *_same_as(j.truth)})
        or (j.group == "held back" and j.size == size)
    ]


def undecided(judged: Judgement, full: Iterable[Judgement]) -> bool:
    """Return whether the whole library, on the same flight, cannot tell the truth from what is
    named without it.
    """
    names = {name.split(" ")[0].rstrip("?") for name in judged.named}
    return any(
        j.key == judged.key and j.right and names <= set(j.classes) - set(j.truth) for j in full
    )


def _same_as(truth: Iterable[str]) -> set[str]:
    return {other for name in truth for other in EQUIVALENTS.get(name, ())}


def _not_wrong(j: Judgement) -> bool:
    return j.outcome not in (WRONG, FAILED)


def _rule(
    subject: str, part: float, bar: float | None, count: int, more: str, at_most: bool = False
) -> Rule:
    if not count:
        return Rule(subject, _target(bar, at_most), "not flown", None, 0)
    met = None if bar is None else bool(part <= bar if at_most else part >= bar)
    return Rule(subject, _target(bar, at_most), f"{part:.1%} {more}".strip(), met, count)


def _target(bar: float | None, at_most: bool = False) -> str:
    return (
        "-" if bar is None else f"{'<=' if at_most else '>='} {bar:.0%}" if bar < 1.0 else "always"
    )


def _share(
    subject: str,
    some: Sequence[Judgement],
    good: Callable[[Judgement], bool],
    bar: float | None,
    at_most: bool = False,
) -> Rule:
    count = sum(map(good, some))
    told = f"({share(count, len(some)).replace(' (', ', ')}"
    return _rule(subject, count / max(len(some), 1), bar, len(some), told, at_most)


def _by_kind(subject: str, some: Sequence[Judgement], bar: float) -> Rule:
    kinds = sorted({j.cause for j in some})
    shares = [float(np.mean([_not_wrong(j) for j in some if j.cause == kind])) for kind in kinds]
    return _rule(
        subject,
        float(np.mean(shares)) if shares else 0.0,
        bar,
        len(some),
        f"({round(sum(shares), 1):g} of {len(kinds)} kinds)",
    )


def _coefficients(subject: str, some: Sequence[Judgement]) -> Rule:
    with_errors = [j for j in some if j.errors]
    if not with_errors:
        return Rule(subject, ">= 95%", "none named", None, 0)
    worst = [max(e for e, _ in j.errors.values()) for j in with_errors]
    within = float(np.mean([e <= COEFFICIENT_BAR for e in worst]))
    every = [pair for j in with_errors for pair in j.errors.values()]
    beyond = [sigmas for e, sigmas in every if e > COEFFICIENT_BAR]
    measured = (
        f"{within:.1%} of flights, {len(every) - len(beyond)} of {len(every)} coefficients; the "
        f"worst of each flight "
        f"is {np.median(worst):.1%} in the median and {max(worst):.1%} at most"
    )
    if beyond:
        measured += (
            f"; those beyond are off by {max(beyond):.1f} of their own standard deviations at most"
        )
    return Rule(subject, ">= 95%", measured, within >= 0.95, len(worst))


def _unbiased(subject: str, some: Sequence[Judgement]) -> Rule:
    """Return how many flights a fit would have within the bar whose errors are normal, with mean
    zero, and as large as said.
    """
    shares = []
    for j in some:
        # an error e of s standard deviations: the bar is at s * bar / e of them
        within = [
            erf(s * COEFFICIENT_BAR / (e * sqrt(2.0)))
            for e, s in j.errors.values()
            if e > 0.0 and np.isfinite(s)
        ]
        if within:
            shares.append(float(np.prod(within)))
    every = [s for j in some for _, s in j.errors.values() if np.isfinite(s)]
    more = (
        f"of flights; {np.mean([s < 1.0 for s in every]):.0%} of the coefficients are within one "
        f"such deviation, "
        f"{np.mean([s < 2.0 for s in every]):.0%} within two"
        if every
        else ""
    )
    return _rule(subject, float(np.mean(shares)) if shares else 0.0, None, len(shares), more)


def _floor(subject: str, some: Sequence[Judgement]) -> Rule:
    worst = max((j.floor_ratio for j in some), default=np.nan)
    return Rule(
        subject,
        f"<= {FLOOR_BAR:g}",
        f"{worst:.2f} at worst" if some else "not flown",
        bool(worst <= FLOOR_BAR) if some else None,
        len(some),
    )


def _probabilities(inside: Sequence[Judgement], foreign: Sequence[Judgement]) -> list[Rule]:
    """Return what the stated probabilities are worth.

    Args:
        inside: diagnoses whose cause, if there is one, is in their library.
        foreign: those whose cause is not.
    """
    least = f"{SEARCH_VERDICT.least_sure_probability:.0%}"
    names = [true for j in inside for true in j.probable]
    known, unknown = (
        [j.unknown for j in some if np.isfinite(j.unknown)] for some in (inside, foreign)
    )
    false = sum(len(j.probable) > 0 for j in foreign)
    return [
        Rule(
            f"8. names with a probability of {least} and more, the cause in the library: true",
            "-",
            share(sum(names), len(names)),
            None,
            len(inside),
        ),
        Rule(
            f"8. the cause not in the library: no name has a probability of {least} and more",
            "-",
            share(len(foreign) - false, len(foreign)),
            None,
            len(foreign),
        ),
        Rule(
            "8. the cause in the library, or not: area under the curve of `unknown`",
            "-",
            area_under_curve(unknown, known) if known and unknown else "not flown",
            None,
            len(known) + len(unknown),
        ),
    ]


def _gusts(some: Sequence[Judgement]) -> Rule:
    ratios = [j.gusts for j in some if np.isfinite(j.gusts)]
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95]) if ratios else (np.nan,) * 3
    measured = (
        f"{middle:.2f} times what is flown in the median, {low:.2f} to {high:.2f} on nine flights "
        "of ten"
    )
    return Rule(
        "-. estimated standard deviation of the force disturbance, where names are right and "
        "there is one",
        "-",
        measured if ratios else "not flown",
        None,
        len(ratios),
    )


def _rotorpy(some: Sequence[Judgement]) -> list[Rule]:
    on, off = [j for j in some if j.truth], [j for j in some if not j.truth]
    wanted = [f"{name}.{c}" for name, cs in _ROTORPY.items() for c in cs]
    errors = [j.errors.get(c, (np.inf, np.inf))[0] for j in on for c in wanted]
    worst = max(errors, default=np.nan)
    found = (
        f"{worst:.1%} at worst"
        if np.isfinite(worst)
        else "not all named"
        if on
        else "not flown: RotorPy is not installed"
    )
    return [
        Rule(
            "7. RotorPy, aerodynamics on: k_d, k_z and k_h within 5 %",
            "always",
            found,
            bool(worst <= COEFFICIENT_BAR) if on else None,
            len(on),
        ),
        _share(
            "7. RotorPy, aerodynamics on: nothing named but its own",
            on,
            lambda j: (
                j.outcome != FAILED and all(n.split(" ")[0].rstrip("?") in j.truth for n in j.named)
            ),
            1.0,
        ),
        _share("7. RotorPy, aerodynamics off: nothing named", off, _names_nothing, 1.0),
    ]
