"""``report.json`` keeps to its published schema, whatever was found."""

import json
import math
from dataclasses import replace

import pytest

from tests.support.diagnoses import made_diagnosis, made_trace
from windwrench.identification.findings import (
    Disturbance,
    Errors,
    Structure,
    TransientDisturbance,
)
from windwrench.identification.report import report_data, report_schema, write_report
from windwrench.identification.report.files import SCHEMA_VERSION

jsonschema = pytest.importorskip("jsonschema")


def diagnoses():
    plain = made_diagnosis()
    yield "explained", plain
    yield "nothing", replace(plain, verdict="nothing to explain", effects=(), traces=())
    yield (
        "much",
        made_diagnosis(
            *(made_trace(5.0, ("rotor_drag", "wind"), log=f"log {i}") for i in range(2)),
            verdict="partly explained",
            remainder="structured",
            test_logs=("third",),
            after=Errors(math.nan, math.inf, math.nan, 0.1),
            structure=(Structure("a wave", "Fx", 0.3),),
            gusts=(Disturbance("tau_z", 0.1, 0.2),),
            pushes=(TransientDisturbance("Fx", "log 0", 1.0, -2.0),),
            rotor_faults=({"log": "log 0", "rotor": None},),
            advice=("Fly.",),
            notes=("A doubt.",),
            needs_pose=("wind",),
            floor_is_bound=True,
        ),
    )


@pytest.mark.parametrize(
    ("kind", "found"), list(diagnoses()), ids=lambda x: x if type(x) is str else ""
)
def test_a_report_keeps_to_its_schema(kind, found, tmp_path):
    numbers = write_report(found, tmp_path)[0]
    data = json.loads(numbers.read_text(encoding="utf-8"))
    jsonschema.validate(data, report_schema())
    assert data["schema_version"] == SCHEMA_VERSION
    # every key that is written is described
    assert set(data) == set(report_schema()["properties"])


def test_the_schema_is_one_and_refuses_what_is_no_report():
    schema = report_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    good = report_data(made_diagnosis())
    for key, wrong in (
        ("verdict", "perhaps"),
        ("effects", [{"name": "wind"}]),
        ("error", {}),
        ("schema_version", "2.0"),
        ("gusts", [{"channel": "F", "rms": 1.0, "time_s": 1.0}]),
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**good, key: wrong}, schema)
    for key in good:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({k: v for k, v in good.items() if k != key}, schema)
