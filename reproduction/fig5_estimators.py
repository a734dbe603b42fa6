"""The estimators of Fig. 5 on recorded flights: run, scored, and tuned anew on flights of their
own.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from ..dynamics import Vehicle
from ..envs.plant import TICK
from ..estimator import UKFTuning, WrenchUKF
from ..estimator.estimate import FORCE as FORCE_STATE
from ..estimator.estimate import NIS, STATE_SIZE
from ..estimator.estimate import TORQUE as TORQUE_STATE
from .fig5_flights import FORCE, STEADY, TORQUE, TRANSIENT, Array, Flight, window
from .observer import NonlinearObserver, ObserverTuning

_FORCE_SIZE = float(np.linalg.norm(FORCE))
_TORQUE_SIZE = float(np.linalg.norm(TORQUE))
_FACTOR = 2.0  # by which the optimiser's first simplex reaches out from the start
_REACH = float(np.log(20.0))
_WORST = 1e3  # cost of an estimate that is not finite

UKF_TUNED = ("motor_torque_noise", "torque_walk", "thrust_noise", "force_walk")
# root mean squares of the error's length: N, N, Nm, Nm
ERRORS = ("force_transient", "force_steady", "torque_transient", "torque_steady")


def states_of(estimator: WrenchUKF, samples: Array) -> Array:
    """Return the states (n, 20) of an estimator after each of a flight's samples (n, 11); the first
    row is the start.
    """
    out = np.zeros((len(samples), STATE_SIZE))
    estimator.reset(samples[0, 4:7], samples[0, 7:11])
    for k in range(1, len(samples)):
        row = samples[k]
        out[k] = estimator.step(row[:4], row[4:7], row[7:11]).state
    return out


def score(states: Array, flight: Flight) -> list[float]:
    """Return the four errors of the states (n, 20) against a flight's truth, and the mean NIS of
    the steady state, NaN where there is none.
    """
    force = np.sum(np.square(states[:, FORCE_STATE] - flight.wrench[:, :3]), axis=1)
    torque = np.sum(np.square(states[:, TORQUE_STATE] - flight.wrench[:, 3:]), axis=1)
    errors = [
        float(np.sqrt(np.mean(square[window(limits)])))
        for square in (force, torque)
        for limits in (TRANSIENT, STEADY)
    ]
    return [*errors, float(np.mean(states[window(STEADY), NIS]))]


def cost(estimator: WrenchUKF, flights: Sequence[Flight]) -> float:
    """Return the mean over the flights of all four errors, each as a share of the step that was
    applied.
    """
    total = 0.0
    for flight in flights:
        force_1, force_2, torque_1, torque_2, _ = score(
            states_of(estimator, flight.samples), flight
        )
        total += (force_1 + force_2) / _FORCE_SIZE + (torque_1 + torque_2) / _TORQUE_SIZE
    return total / len(flights) if np.isfinite(total) else _WORST


def tune(
    vehicle: Vehicle, flights: Sequence[Flight], evaluations: int
) -> tuple[UKFTuning, ObserverTuning]:
    """Return the filter's process noise, and the observer's gains and cutoffs, that err least on
    ``flights``, by Nelder and Mead on their logarithms. What is measured is as noisy as it is.

    For the observer other starts, a budget of 600 and differential evolution all led to the same
    tuning.
    """
    base = UKFTuning.for_vehicle(vehicle, TICK)
    default = np.array([float(np.asarray(getattr(base, name))) for name in UKF_TUNED])

    def of_ukf(p: Array) -> UKFTuning:
        return replace(base, **dict(zip(UKF_TUNED, p.tolist(), strict=True)))

    def of_observer(p: Array) -> ObserverTuning:
        return ObserverTuning(*p.tolist())

    # the default believes the rotors too little for any of these flights
    ukf = _best(
        lambda p: WrenchUKF(vehicle, of_ukf(p), TICK),
        default * [0.1, 2.0, 0.1, 2.0],
        flights,
        evaluations,
    )
    # much faster than the default: from there the optimum is a walk along one valley, slower pose
    # against faster gain
    observer = _best(
        lambda p: NonlinearObserver(vehicle, of_observer(p), TICK),
        np.array([3.0, 6.0, 10.0, 10.0]),
        flights,
        evaluations,
    )
    return of_ukf(ukf), of_observer(observer)


def _best(
    build: Callable[[Array], WrenchUKF],
    start: Array,
    flights: Sequence[Flight],
    evaluations: int,
) -> Array:
    """Return the parameters, all positive, that cost least; none further than a factor of 20 from
    its start.

    The limit matters on the exact plant, where the best white noise of the rotors is zero.
    """
    centre = np.log(start)

    def parameters(offset: Array) -> Array:
        return np.asarray(np.exp(centre + np.clip(offset, -_REACH, _REACH)))

    simplex = np.vstack([np.zeros_like(centre), np.log(_FACTOR) * np.eye(len(centre))])
    result = minimize(
        lambda offset: cost(build(parameters(offset)), flights),
        np.zeros(len(centre)),
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex,
            "maxfev": evaluations,
            "xatol": 0.01,
            "fatol": 1e-5,
        },
    )
    return parameters(result.x)
