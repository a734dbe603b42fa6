"""Simulated flights with effects."""

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog

VEHICLE = load_vehicle("ardrone2")
DRAG = {"kdx": 1.2e-4, "kdy": 1.2e-4}


def settings(effects):
    """Return effects of a vehicle from their coefficients by name."""
    return tuple(EffectSetting(name, dict(values)) for name, values in effects.items())


def recorded(
    trajectory="excite", seconds=20.0, seed=1, background=None, vehicle=VEHICLE, **effects
):
    """Return the log of a simulated flight with effects, each by its coefficients."""
    c = record_flight(vehicle, settings(effects), trajectory, seconds, seed, background)
    return FlightLog(c["t"], c["position"], c["quaternion"], c["rotor_speeds"], c["voltage"])
