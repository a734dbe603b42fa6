"""Diagnoses made of numbers, for what is done with one after it has been made."""

from dataclasses import replace

import numpy as np
from numpy.random import default_rng

from windwrench.dynamics import load_vehicle
from windwrench.identification.findings import (
    Candidate,
    Diagnosis,
    Errors,
    NamedEffect,
    Signature,
    Trace,
)


def made_trace(seconds=60.0, effects=("rotor_drag",), rate=25.0, seed=0, log="flight"):
    """A residual that each of some effects has a share of, and noise."""
    rng = default_rng(seed)
    t = 1.5 + np.arange(round(seconds * rate)) / rate
    after = 0.02 * rng.standard_normal((len(t), 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    parts = {
        name: (0.1 + 0.05 * i)
        * np.sin(0.5 * (1 + i) * t[:, None] + np.arange(6))
        * [1, 1, 0, 0, 0.1, 0.1]
        for i, name in enumerate(effects)
    }
    return Trace(log, 1.0 / rate, t, after + sum(parts.values()), after, t % 12 < 3, parts)


def made_diagnosis(*traces, **more):
    """A diagnosis that names the effects which the traces have."""
    traces = traces or (made_trace(),)
    names = tuple(traces[0].parts)
    effect = NamedEffect(
        "", {"kdx": 2.4e-4}, {"kdx": 3e-6}, {"kdx": "N/(rad/s m/s)"}, False, (), {"share": 0.9}
    )
    before = np.concatenate([t.before for t in traces])
    after = np.concatenate([t.after for t in traces])

    def errors(x):
        return Errors(float(x[:, :3].std()), float(x[:, 3:].std()), 7.1, 0.05)

    made = Diagnosis(
        verdict="explained" if names else "nothing to explain",
        remainder="none",
        effects=tuple(replace(effect, name=name) for name in names),
        held_out_segments=tuple((trace.log, 12.0, 15.0) for trace in traces),
        before=errors(before),
        after=errors(after),
        floor_force_rms=0.019,
        floor_torque_rms=0.0019,
        advice=(),
        notes=(),
        candidates=(*(Candidate(name, 0.6, True) for name in names), Candidate("wind", 0.1, False)),
        traces=tuple(traces),
        signatures=tuple(
            Signature(
                name,
                "Fx",
                "body velocity x (m/s)",
                traces[0].t % 1.0,
                traces[0].before[:, 0],
                traces[0].parts[name][:, 0],
            )
            for name in names
        ),
        structure=(),
        gusts=(),
        pushes=(),
        cutoff_hz=5.0,
        declared=load_vehicle("ardrone2"),
        amended=load_vehicle("ardrone2"),
        logs=tuple(trace.log for trace in traces),
        test_logs=(),
        seconds=float(sum(trace.t[-1] - trace.t[0] for trace in traces)),
    )
    return replace(made, **more)
