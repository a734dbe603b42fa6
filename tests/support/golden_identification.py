"""What identification says of made flights, kept: ``python -m tests.support.golden_identification``
writes it anew after a change that is meant.
"""

import json
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.random import default_rng

from tests.identification.comparison.test_change import drawn
from tests.identification.vehicle_fit.flown import ARM, MASS, inertial_flights
from tests.support.flown import recorded
from tests.support.paths import ROOT
from windwrench.dynamics import load_vehicle
from windwrench.identification.comparison.change import compare
from windwrench.identification.comparison.fault_channels import samples_of
from windwrench.identification.comparison.fault_detection import find_fault
from windwrench.identification.comparison.words import change_data, fault_data
from windwrench.identification.vehicle_fit.exports import EXPORTS
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.identification.vehicle_fit.report import identified_data

GOLDEN = ROOT / "tests" / "golden" / "identification.json"
CRAZYFLIE = load_vehicle("crazyflie")
LAG = {"motor_lag": {"tau": 0.06}, "body_drag": {"dx": 0.02}}


def failing_flight():
    """An IMU flight whose rotor 3 loses 40 % of its thrust at 6 s, without the loop's answer."""
    log, speeds = inertial_flights()[3]
    lost = np.where(log.t > 6.0, 0.4, 0.0) * 6.0e-6 * speeds[:, 2] ** 2
    force = log.accelerometer.copy()
    rate = log.gyro.copy()
    force[:, 2] -= lost / MASS
    turn = np.column_stack([ARM * lost / 3.0e-3, -ARM * lost / 3.6e-3, -0.02 * lost / 6.0e-3])
    rate += np.cumsum(turn * (log.t < 6.4)[:, None], axis=0) * log.period
    return replace(log, accelerometer=force, gyro=rate)


@cache
def posed():
    """A flight of a Crazyflie with a lag and a drag that nobody declared."""
    return [recorded("excite", 12.0, vehicle=CRAZYFLIE, **LAG)]


@cache
def vehicles():
    """Vehicles identified from each kind of log."""
    one, speeds = inertial_flights()[0]
    arm = parse_geometry(str(ARM))
    return {
        "imu and commands": identify([replace(one, voltage=np.full(len(one.t), 3.9))], MASS, arm),
        "imu, commands and speeds": identify([replace(one, rotor_speeds=speeds)], MASS, arm),
        "pose without an arm": identify(posed(), CRAZYFLIE.mass, parse_geometry(None)),
    }


def said(found):
    """Return what is said of a vehicle, of its predictions the end of the horizon alone."""
    data = identified_data(found)
    for where in found.predicted:
        data[where]["horizon_s"] = data[where]["horizon_s"][-1:]
        for errors in (x for x in data[where].values() if isinstance(x, dict)):
            errors |= {name: errors[name][-1:] for name in ("model", "if_nothing_changes")}
    return data


def made():
    """Return all that is kept, as plain data."""
    one = inertial_flights()[0][0]
    rng = default_rng(4)
    changes = {
        str(moved): compare(drawn(rng, 2, moved), drawn(rng, 3))
        for moved in ((0.0, 0.0, 0.0, 0.0), (0.08, -0.08, 0.08, 0.08), (0.1, 0.0, 0.0, 0.1))
    }
    faults = {
        "none": find_fault(samples_of(one)),
        "rotor": find_fault(samples_of(failing_flight())),
    }
    return {
        "identified": {name: said(v) for name, v in vehicles().items()},
        "exports": {n: {k: f(v) for k, f in EXPORTS.items()} for n, v in vehicles().items()},
        "changes": {name: change_data(change) for name, change in changes.items()},
        "faults": {name: fault_data(fault) for name, fault in faults.items()},
    }


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(made(), indent=1) + "\n", encoding="utf-8")
