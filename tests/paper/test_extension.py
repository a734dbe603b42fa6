"""A short form of the extension: what further sensors and a mass state buy."""

import numpy as np
import pytest

from windwrench.paper import extension


@pytest.fixture(scope="module")
def short(request):
    saved = extension.RISE_TIMES, extension.TRUST
    extension.RISE_TIMES, extension.TRUST = (0.2, 0.8), (0.03, 0.1)
    try:
        yield extension.run(1, lambda share: None)
    finally:
        extension.RISE_TIMES, extension.TRUST = saved


def test_an_imu_is_faster_at_the_same_spread(short):
    for what in ("vertical force", "lateral force", "torque"):
        rise = short.figures["rise_at_equal_spread"][what]["rise_s"]
        assert rise["pose, gyro, accelerometer"] < 0.7 * rise["pose"], what
    assert (
        short.figures["rise_at_equal_spread"]["torque"]["rise_s"]["position, gyro, accelerometer"]
        < 0.6
    )


def test_a_flight_with_vertical_acceleration_separates_mass_from_force(short):
    hover, excite = short.figures["mass"]
    assert hover["plain_fz_mean_N"] == pytest.approx(-0.52, abs=0.02)
    assert abs(excite["mass_error_g"]) < 3.0
    assert excite["mass_std_of_filter_g"] < 0.2 * hover["mass_std_of_filter_g"]
    assert abs(excite["massive_fz_mean_N"]) < 0.02
    assert excite["massive_fz_std_N"] < 0.3 * excite["plain_fz_std_N"]


def test_the_data_are_a_table(short):
    lengths = {len(column) for column in short.data.values()}
    assert lengths == {16}
    assert np.isfinite(short.data["force_std_N"]).all()
