"""What holds for the whole suite."""

import subprocess
import sys

FLOWN = """
from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.wrench_series import estimate_log
vehicle = load_vehicle("ardrone2")
estimate_log(FlightLog(**record_flight(vehicle, (), "hover", 1.0, seed=0)), vehicle)
"""


def pytest_configure(config):
    """Compile what most files need before workers start, or each of them compiles it."""
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        # a failure is no answer here: the tests that need it will give theirs
        subprocess.run([sys.executable, "-c", FLOWN], capture_output=True, check=False)
