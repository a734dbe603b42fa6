"""A physical effect of one's own: written once, flown as truth, and named by a diagnosis that knows
of it.

The effect is ``effects/tether.py`` beside this script, an elastic thread to a hook in the room. On
the command line a folder of effects is known by ``WINDWRENCH_EFFECTS=examples/effects``.

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
    found = diagnose([log], vehicle)
    print(f"verdict: {found.verdict}")
    for effect in found.effects:
        for name, value in effect.coefficients.items():
            print(
                f"{effect.name}: {name} = {value:.4f} +- {effect.std[name]:.4f} "
                f"{effect.units[name]}"
            )
    print(f"truth: tether: k = {stiffness:.4f} N/m")
    print(
        f"force left over: {found.before.force_rms:.3f} N before, {found.after.force_rms:.3f} N "
        f"after; "
        f"the sensors alone leave {found.floor_force_rms:.3f} N"
    )
    return found


if __name__ == "__main__":
    main()
