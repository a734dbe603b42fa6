"""What the tests of logs share."""

import pytest


@pytest.fixture
def write(tmp_path):
    """Write bytes to a file; return its path."""

    def to_file(data, name="log03"):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return to_file
