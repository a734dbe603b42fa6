"""Flights as a regression on the coefficients of effects: the sensors' noise in rows and columns,
and the effects hidden by this noise.
"""

from collections.abc import Iterable
from typing import Self

import numpy as np

from ...dynamics.effects import Need, Role, get, names, needing, playing
from ...dynamics.vehicle import Vehicle
from ..logs.flight_log import Logs
from ..logs.table import Array
from ..motion.sensor_noise import noisy_logs
from ..motion.smoothing import mean_square
from .coefficients import CENTRAL, Effects, is_nonlinear, typical_sizes
from .column import Column
from .flight_rows import FlightRows

# share of sensor noise in the power of an effect's column, beyond which the effect is not
# identifiable. A scaled measurement could cancel its own noise: there the share is of the amplitude
MOST_NOISE_SHARE = 0.1
# not known where rotor speeds come from commands: torque is left out, the thrust curve is a guess,
# and commands do not tell small differences between rotors
NOT_COMMANDED = (Need.MOMENTS, Need.SINGLE_ROTORS)
LARGE_STEP = 0.5  # typical sizes: a signal moves in time by a sample, not by a part of one


class RegressedFlights(FlightRows):
    """Flights of one vehicle as rows of a regression, with the noise of their sensors.

    Args:
        logs: the logs to fit.
        vehicle: as declared.
        test: further logs outside the fit; without any, one block of 3 s of each four is held out.
    """

    def __init__(self, logs: Logs, vehicle: Vehicle, test: Logs = ()) -> None:
        super().__init__(logs, vehicle, test)
        # in a log read by its IMU: effects without any trace, and effects a pose would show
        self.without_trace = self.needs_pose = Effects()
        # the noise is added to the logs once more; the change is the effect of noise
        noisy = self._of(noisy_logs(self.logs, vehicle))
        self.visible_noise = noisy.residual({}) - self.residual({})  # (rows, 6), as logged
        # identifiability depends on all noise, visible or hidden
        if self.filtered:
            noisy = self._of(noisy_logs(self.logs, vehicle, hidden=True))
        self.sensor_noise = noisy.residual({}) - self.residual({})  # (rows, 6)
        # effects whose columns are sensor noise to a large part
        self.not_identifiable = self._lost_in_noise(noisy)
        rotors = self.rotor_wrench({})
        more = noisy.rotor_wrench({})
        # (4,) its share of the variance of what the rotors deliver: thrust and torque
        self.rotor_noise = np.var(more - rotors, axis=0) / np.maximum(np.var(rotors, axis=0), 1e-30)

    def of_the_fit(self) -> Self:
        """Return the flights without the test logs."""
        out = self._of(self.logs[: self._fit_logs])
        out._first = [piece for piece in self._first if piece.log < self._fit_logs]
        kept = self.log < self._fit_logs
        for name in ("log", "block", "fit_rows", "start", "t", "visible_noise", "sensor_noise"):
            setattr(out, name, getattr(self, name)[kept])
        return out

    def _lost_in_noise(self, noisy: Self) -> Effects:
        """Return the effects whose columns are largely noise.

        A fit of such an effect would come out too small, or remove noise of the pose to explain
        noise of the residual. With a causal filter, the effect would mend the filter's gains.
        """
        lost, _ = self._noisy_columns(noisy, [e for e in names() if not is_nonlinear(e)])
        unsaid: Effects = needing(*NOT_COMMANDED) if self.commanded else frozenset()
        if self.inertial:
            # a column also depends on states the IMU hardly shows
            quietly = lost  # lost in sensor noise alone
            noisy._forget()
            noisy._drift = np.random.default_rng(1)
            lost, self.without_trace = self._noisy_columns(noisy, names())
            lacking = unsaid  # effects a pose would not show either
            if all(log.voltage is None for log in self.logs):
                lacking |= set(playing(Role.THRUST_OVER_VOLTAGE))
            self.needs_pose = lost - (quietly - self.without_trace) - lacking
        lost |= unsaid
        if self.filtered:
            lost |= needing(Need.FAST_MOTION)
        if not self.rotor_speeds_vary:
            lost |= needing(Need.FINE_ROTOR_SPEEDS)
        return lost

    def _noisy_columns(self, noisy: Self, effects: Iterable[str]) -> tuple[Effects, Effects]:
        """Return the effects whose columns hold too much noise, and the effects without any trace
        in an IMU.
        """
        weight = 1.0 / (mean_square(self.sensor_noise) + 1e-30)
        lost = set()
        traceless = set()
        for effect in effects:
            noise = whole = 0.0
            pairs = zip(self._typical_parts(effect), noisy._typical_parts(effect), strict=True)
            for quiet, loud in pairs:
                turned = loud if noisy._drift is None else self._in_own_axes(loud, noisy)
                noise += float(weight @ mean_square(turned - quiet))
                whole += float(weight @ mean_square(quiet))
            most = MOST_NOISE_SHARE ** (2 if get(effect).scales_noise else 1)
            if self.inertial and whole == 0.0:
                traceless.add(effect)
            if effect in traceless or noise > most * whole:
                lost.add(effect)
        return frozenset(lost), frozenset(traceless)

    def _typical_parts(self, effect: str) -> list[Array]:
        """Return the columns of an effect (rows, 6) at typical coefficients, one by one, or as one
        where the force is not linear in them.
        """
        typical = typical_sizes(effect, self.vehicle)
        if is_nonlinear(effect):
            return [self.residual({}) - self.residual({effect: typical})]
        own = [Column(effect, name) for name in typical if name != CENTRAL]
        columns = self.columns({}, own, self.residual, LARGE_STEP)
        return [typical[c.coefficient] * x for c, x in columns.items()]

    def _in_own_axes(self, x: Array, noisy: Self) -> Array:
        """Return a column (rows, 6) of a copy with other errors of the fusion, its force turned
        from the copy's attitude to this one's.

        A wrong attitude turns needed and modelled force alike: only forces outside the body's axes
        change with the attitude.
        """
        own, other = (flights.at_rows("rotation") for flights in (self, noisy))
        return np.column_stack([np.einsum("nij,nkj,nk->ni", own, other, x[:, :3]), x[:, 3:]])
