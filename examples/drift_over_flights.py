"""The drift of a coefficient over flights: a diagnosis of each log of a folder, and a regression on
time.

Names of logs are times, such as 2026-03-01T1030.ulg. Only flights with a named effect count: a
diagnosis gives no coefficient of an effect too small to be named.

Install:  pip install .    (in a checkout)
Run:      python examples/drift_over_flights.py FOLDER crazyflie rotor_drag kdx
"""

import sys
from datetime import datetime
from pathlib import Path

from scipy.stats import linregress, t

from windwrench.dynamics import InputError, load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.logs.reading import read_log


def main(folder, vehicle, effect, coefficient):
    """Print and return the trend per day with its 95 % interval: (trend, low, high)."""
    model = load_vehicle(vehicle)
    days, values = [], []
    for path in sorted(Path(folder).iterdir()):
        try:
            diagnosis = diagnose([read_log(path, vehicle=model)], model)
        except InputError as error:
            print(f"{path.name}: left out: {error}")
            continue
        print(f"{path.name}: {[named.name for named in diagnosis.effects]}")
        for named in diagnosis.effects:
            if named.name == effect:
                flown = datetime.fromisoformat(path.name.partition(".")[0])
                days.append(flown.timestamp() / 86400.0)
                values.append(named.coefficients[coefficient])
    if len(days) < 3:
        sys.exit(f"{len(days)} flights name {effect}; a trend with an interval needs 3")
    line = linregress(days, values)
    half = t.ppf(0.975, len(days) - 2) * line.stderr
    trend = tuple(map(float, (line.slope, line.slope - half, line.slope + half)))
    print("{} of {}: {:.3g} a day, 95 % [{:.3g}, {:.3g}]".format(coefficient, effect, *trend))
    return trend


if __name__ == "__main__":
    main(*sys.argv[1:])
