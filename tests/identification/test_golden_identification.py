"""What identification says of made flights is what it said before."""

import json

from tests.support.alike import assert_alike
from tests.support.golden_identification import GOLDEN, made


def test_results_are_those_kept():
    assert_alike(json.loads(json.dumps(made())), json.loads(GOLDEN.read_text(encoding="utf-8")))
