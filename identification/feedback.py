"""Whether what seems to explain a residual acts as a law does, or is the flight loop's answer to it, or noise that both share.

A flight loop works against every disturbance, so rotors, attitude and velocity follow a gust, and a law of one of these seems
to explain it. But a law acts at once, and an answer comes a moment later: shifted in time, what a law explains falls off alike
to either side, and an answer fits best when it is taken from the near future, be it with the other sign. (The bias of the
direct method in closed loop: L. Ljung, System Identification, 2nd edition, 1999, section 13.4.) And a law's motion lasts: what
explains nothing once it is taken a row earlier or later is noise of the pose, which is in the residual and in what is made of
the attitude.
"""

import numpy as np
from numpy.typing import NDArray

from .regression import Flights
from .whitening import Whitener

Array = NDArray[np.float64]

# of what is left unexplained: what explains more is not asked; an answer to gusts seldom does (0.22 was seen in strong ones)
ANSWERS_SHARE = 0.2
_LAG = 0.08  # s, about as long as an attitude loop takes
_LATE = 0.16  # s, by when its answer to a gust of any kind has come
_SHARE = 0.1  # of what is explained, by which the future may explain more than the past
_NOISE = 3.0  # standard deviations of that difference
_TURNED = 1.5  # times what is explained, that the future may not explain with the other sign
_LASTS = 0.5  # of what is explained, that a row later or earlier must explain; true laws of all kinds have 0.85 and more


def is_law(flights: Flights, whiten: Whitener, explained: Array, remainder: Array) -> bool:
    """Return whether ``explained`` (rows, 6), or a multiple of it, acts on ``remainder`` (rows, 6) at once, and lasts."""
    lag, late = max(1, round(_LAG / flights.period)), max(2, round(_LATE / flights.period))
    whole, wanted = whiten(explained), whiten(remainder)[flights.fit]

    def energy(shift: int) -> float:
        x = _shifted(whole, shift, flights)[flights.fit]
        along = float(np.sum(x * wanted))
        return along * abs(along) / max(float(np.sum(x * x)), 1e-300)

    sign = np.sign(energy(0))
    now, later = abs(energy(0)), [sign * energy(rows) for rows in range(1, late + 1)]
    answers = later[lag - 1] - sign * energy(-lag) > _SHARE * now + _NOISE * np.sqrt(now) or min(later) < -_TURNED * now
    lasts = max(later[0], sign * energy(-1)) > _LASTS * now
    return bool(lasts and not answers)


def _shifted(x: Array, rows: int, flights: Flights) -> Array:
    """Return ``x`` (rows, 6) as it is ``rows`` later, within each unbroken piece; the last value stands for what is beyond."""
    begins = np.flatnonzero(flights.start)
    ends = np.append(begins[1:], len(x))
    piece = np.cumsum(flights.start) - 1
    return x[np.clip(np.arange(len(x)) + rows, begins[piece], ends[piece] - 1)]
