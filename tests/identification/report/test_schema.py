"""``report.json`` keeps to its published schema, whatever was found."""

import json
import math
from dataclasses import replace

import pytest

from tests.support.diagnoses import made_diagnosis, made_trace
from tests.support.golden_report import diagnoses
from windwrench.identification.findings import Errors
from windwrench.identification.report import report_data, report_schema
from windwrench.identification.report.files import SCHEMA_VERSION

jsonschema = pytest.importorskip("jsonschema")


def test_a_report_keeps_to_its_schema():
    traces = (made_trace(5.0, ("rotor_drag", "wind"), log=f"log {i}") for i in range(2))
    lost = Errors(math.nan, math.inf, math.nan, 0.1)
    much = made_diagnosis(*traces, after=lost, rotor_faults=({"log": "log 0", "rotor": None},))
    bare = replace(much, verdict="nothing to explain", effects=(), traces=())
    for found in (much, bare, *(found for _, found in diagnoses())):
        data = json.loads(json.dumps(report_data(found), allow_nan=False))
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
