"""Your own physical effect: written once, flown in simulation, and named by the diagnosis.

The effect is ``effects/tether.py``: an elastic thread from the vehicle to a hook in the room.
Commands load a folder of effects from ``WINDWRENCH_EFFECTS=examples/effects``.

Install:  pip install .    (in a checkout)
Run:      python examples/custom_effect.py
"""

from pathlib import Path

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import add_folder
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.recording import record_flight
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.flight_log import FlightLog


def main(seconds=60.0, stiffness=0.1, seed=0):
    """Fly a tethered vehicle that declares no tether, diagnose the log, print and return the
    diagnosis.
    """
    added = add_folder(Path(__file__).parent / "effects")
    print(f"added to the library: {', '.join(added)}")
    vehicle = load_vehicle("ardrone2")
    flown = record_flight(
        vehicle, (EffectSetting("tether", {"k": stiffness}),), "excite", seconds, seed
    )
    log = FlightLog(
        flown["t"], flown["position"], flown["quaternion"], flown["rotor_speeds"], name="tethered"
    )
    diagnosis = diagnose([log], vehicle)
    print(f"verdict: {diagnosis.verdict}")
    for effect in diagnosis.effects:
        for name, value in effect.coefficients.items():
            print(
                f"{effect.name}: {name} = {value:.4f} +- {effect.std[name]:.4f} "
                f"{effect.units[name]}"
            )
    print(f"truth: tether: k = {stiffness:.4f} N/m")
    print(
        f"force error: {diagnosis.before.force_rms:.3f} N before, "
        f"{diagnosis.after.force_rms:.3f} N after; sensors alone: {diagnosis.floor_force_rms:.3f} N"
    )
    return diagnosis


if __name__ == "__main__":
    main()
