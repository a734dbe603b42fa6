"""What a report says of made diagnoses, kept: ``python -m tests.support.golden_report`` writes it
anew after a change that is meant.
"""

import json
import math
from dataclasses import replace

from tests.support.diagnoses import made_diagnosis, made_trace
from tests.support.paths import ROOT
from windwrench.dynamics import EffectSetting
from windwrench.identification.findings import (
    Alternative,
    Candidate,
    Disturbance,
    NamedEffect,
    Probabilities,
    Structure,
    TransientDisturbance,
)
from windwrench.identification.report import words
from windwrench.identification.report.headline import headline

GOLDEN = ROOT / "tests" / "golden" / "report_words.json"


def diagnoses():
    """Yield diagnoses that differ in what may be said of them, each with its name."""
    made = made_diagnosis(made_trace(5.0))
    (drag,) = made.effects
    other = {name: replace(drag, name=name) for name in ("mass", "wind", "battery_sag")}
    wind = NamedEffect(
        "wind", {"wx": 1.0, "wy": math.nan}, {"wx": 0.2}, {"wx": "m/s"}, True, (), {}
    )
    centre = replace(drag, name="com_offset", indistinguishable_from=("rotor_efficiency",))
    sag = replace(other["battery_sag"], indistinguishable_from=("rotor_efficiency", "mass"))
    doubtful = replace(drag, tentative=True)
    for name, effects in {
        "sure": (drag,),
        "sure and unsure": (drag, other["mass"], wind),
        "unsure": (wind,),
        "undecided": (centre,),
        "two undecided": (centre, sag),
        "sure and undecided": (drag, centre),
        "undecided and unsure": (replace(centre, tentative=True),),
        "nothing": (),
    }.items():
        for verdict, remainder in (
            ("explained" if effects else "nothing to explain", "none"),
            ("partly explained" if effects else "unexplained", "random"),
            ("partly explained" if effects else "unexplained", "structured"),
        ):
            found = replace(made, verdict=verdict, remainder=remainder, effects=effects)
            yield f"{name}, {verdict}, {remainder}", found
    partly = replace(made, verdict="partly explained", remainder="random")
    declared = made.declared.with_effects(EffectSetting("rotor_drag", drag.coefficients))
    for name, effects in {
        "declared": (drag,),
        "declared and new": (other["mass"], drag, replace(other["wind"], tentative=True)),
        "declared, perhaps": (doubtful,),
    }.items():
        yield name, replace(made, declared=declared, effects=effects)
    yield "a floor that is a bound", replace(partly, floor_is_bound=True)
    yield "needs a pose", replace(partly, effects=(), verdict="unexplained", needs_pose=("wind",))
    yield "errors that grow", replace(partly, after=replace(made.after, force_rms=9.0))
    yield "errors unknown", replace(partly, after=replace(made.after, force_rms=math.nan))
    yield "advised", replace(partly, advice=("Fly higher. " * 40,))
    yield "test logs", replace(partly, test_logs=("third",))
    gusts = (Disturbance("Fx", 0.0153, 0.25), Disturbance("tau_z", 0.0004, 0.11))
    yield "disturbed", replace(partly, gusts=gusts)
    pushes = (TransientDisturbance("tau_x", "flight", 1.5, -0.002),)
    yield "pushed", replace(partly, pushes=pushes)
    signs = (Structure("a wave at 1.1 Hz", "Fx", 0.31),)
    yield "structured", replace(partly, remainder="structured", structure=signs)
    ranked = [("rotor_efficiency", 0.9), ("mass", 0.8), ("rotor_drag", 0.5), ("wind", 0.4)]
    candidates = tuple(Candidate(n, gain, n == "rotor_drag") for n, gain in ranked)
    rival = replace(drag, indistinguishable_from=("rotor_efficiency",))
    yield "ranked otherwise", replace(made, effects=(rival,), candidates=candidates)
    stated = Probabilities({"rotor_drag": 0.95}, (Alternative((), 0.05),), 0.03)
    yield "probabilities", replace(made, probabilities=stated)
    outside = Probabilities({"rotor_drag": 0.05}, (), 0.95)
    unlike = replace(partly, remainder="structured", structure=signs, probabilities=outside)
    yield "outside the library", unlike
    yield "outside, pushed", replace(unlike, effects=(), structure=(), pushes=pushes)
    yield "outside, doubtful log", replace(unlike, notes=("flight: warning: pz stands still",))


def said():
    """Return all sentences of each diagnosis."""
    return {
        name: {
            "headline": headline(found),
            "error": words.error_sentences(found),
            "remainder": words.remainder_sentence(found),
            "next": words.next_step(found),
        }
        for name, found in diagnoses()
    }


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(said(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
