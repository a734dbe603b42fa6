"""Lists of parameters of which a few are quick to show what all of them do."""

import pytest


def mostly_slow(values, quick):
    """Return the values with the mark ``slow`` on those that are not quick."""
    return [v if quick(v) else pytest.param(v, marks=pytest.mark.slow) for v in values]
