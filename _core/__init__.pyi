"""The compiled core: what is computed at every step."""

from typing import Annotated

import numpy
from numpy.typing import NDArray

def instruction_set() -> str:
    """Return the instruction set that the core was built for: baseline, avx2 or avx512."""

class Batch:
    def __init__(self, address: int, count: int) -> None:
        """Filters side by side, `count` like the one at an address, without effects."""

    def put(self, n: int, address: int) -> None:
        """Let filter n stand where the one at an address stands."""

    def step(
        self,
        z: Annotated[
            NDArray[numpy.float64], dict(shape=(None, 11), order="C", device="cpu", writable=False)
        ],
        numbers: Annotated[NDArray[numpy.float64], dict(shape=(None, 30), order="C", device="cpu")],
        variances: Annotated[
            NDArray[numpy.float64], dict(shape=(None, 18), order="C", device="cpu")
        ],
    ) -> None:
        """Step all over a period: samples (n, 11), rotor speeds rad/s, position m and quaternion,
        NaN where nothing was measured; estimates (n, 30) and variances of the error states
        (n, 18), written.
        """

    def covariance(
        self,
        out: Annotated[NDArray[numpy.float64], dict(shape=(None, 18, 18), order="C", device="cpu")],
    ) -> None:
        """Write the covariances (n, 18, 18), of noise alone."""

    def __getstate__(self) -> tuple[int, bytes]: ...
    def __setstate__(self, arg: tuple[int, bytes], /) -> None: ...

class SingleBatch:
    def __init__(self, address: int, count: int) -> None:
        """Filters side by side, `count` like the one at an address, without effects."""

    def put(self, n: int, address: int) -> None:
        """Let filter n stand where the one at an address stands."""

    def step(
        self,
        z: Annotated[
            NDArray[numpy.float64], dict(shape=(None, 11), order="C", device="cpu", writable=False)
        ],
        numbers: Annotated[NDArray[numpy.float64], dict(shape=(None, 30), order="C", device="cpu")],
        variances: Annotated[
            NDArray[numpy.float64], dict(shape=(None, 18), order="C", device="cpu")
        ],
    ) -> None:
        """Step all over a period: samples (n, 11), rotor speeds rad/s, position m and quaternion,
        NaN where nothing was measured; estimates (n, 30) and variances of the error states
        (n, 18), written.
        """

    def covariance(
        self,
        out: Annotated[NDArray[numpy.float64], dict(shape=(None, 18, 18), order="C", device="cpu")],
    ) -> None:
        """Write the covariances (n, 18, 18), of noise alone."""

    def __getstate__(self) -> tuple[int, bytes]: ...
    def __setstate__(self, arg: tuple[int, bytes], /) -> None: ...

FLIGHT_SIZE: int

def move_setpoint(
    flight: int,
    position: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    dt: float,
) -> None:
    """Move the set point of the flight loop at an address with its own velocity for dt s; on an
    axis where it runs too far ahead of the position (3,) m it waits.
    """

def steer(
    flight: int,
    x: Annotated[NDArray[numpy.float64], dict(shape=(20), order="C", device="cpu", writable=False)],
    command: Annotated[
        NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)
    ],
    kind: int,
    dt: float,
) -> None:
    """Fly a command (4,) of a kind in the estimated state x (20,), and write the rotor speeds into
    the flight loop at an address.
    """

def foresee(
    flight: int,
    model: int,
    x: Annotated[NDArray[numpy.float64], dict(shape=(20), order="C", device="cpu", writable=False)],
) -> None:
    """Write the wrench of the effects of the model at an address, for the rotors to balance, into
    the flight loop at an address; x (20,) is the estimated state.
    """

def through_the_rotors(flight: int, model: int) -> None:
    """Turn the rotor speeds commanded by the flight loop at an address into commands that deliver
    them by the model at an address.
    """

def weigh(
    place: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    level: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    memory: Annotated[NDArray[numpy.float64], dict(shape=(None, 21), order="C", device="cpu")],
    own: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    seen: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    tables: Annotated[
        NDArray[numpy.float64], dict(shape=(301, 4, 3), order="C", device="cpu", writable=False)
    ],
    keep: Annotated[
        NDArray[numpy.float64], dict(shape=(3, 3, 3), order="C", device="cpu", writable=False)
    ],
    enter: Annotated[
        NDArray[numpy.float64], dict(shape=(3, 3), order="C", device="cpu", writable=False)
    ],
    regression: Annotated[
        NDArray[numpy.float64], dict(shape=(4, 3, 3), order="C", device="cpu", writable=False)
    ],
    variance: Annotated[
        NDArray[numpy.float64], dict(shape=(4, 3), order="C", device="cpu", writable=False)
    ],
    decision: int,
    out: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
) -> None:
    """Write the log-likelihood of an observation for each particle into out (n,), and carry its
    memory (n, 21) on: places (n,) m of the fan, levels (n,) of the noise, the vehicle's own place
    m, velocity m/s and yaw rate rad/s, the estimated torque and forces (3,), and a tracker's
    tables; at the first decision, 0, the filter has settled on the jet where it is.
    """

FILTER_SIZE: int

def step(address: int, parts: int, dt: float, voltage: float, white: int) -> int:
    """Predict the filter at an address over dt s if that is positive, then correct with the
    parts (1 position, 2 attitude) of the sample in its memory that were measured; voltage in
    V. The pose's whitened innovation (6,) is written at the address `white`.

    Return the parts that could be used, or -1, with the filter as it was, if the quaternion
    is no rotation.
    """

def step_address() -> int:
    """Return the address of `step` for compiled loops: a C function with the same arguments."""

def forget_biases(address: int) -> None:
    """Give the biases of gyro and accelerometer their prior."""

def start(address: int) -> None:
    """Start at the pose in the memory: without an inertial measurement, and as the pose was before
    the declared sensing effects.
    """

def take_in_imu(
    address: int,
    z: Annotated[NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu", writable=False)],
    gyro: bool,
    accelerometer: bool,
) -> None:
    """Correct with the measured parts of z (6,): gyro, rad/s, and accelerometer, m/s2, body."""

def add_doubt(
    address: int,
    variances: Annotated[NDArray[numpy.float64], dict(shape=(18), order="C", device="cpu")],
) -> None:
    """Widen an estimate's variances (18,) by refused and unlikely poses, in place."""

def step_many(
    address: int,
    stride: int,
    z: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 11), order="C", device="cpu", writable=False)
    ],
    parts: int,
    dt: float,
    voltage: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    numbers: Annotated[NDArray[numpy.float64], dict(shape=(None, 30), order="C", device="cpu")],
    variances: Annotated[NDArray[numpy.float64], dict(shape=(None, 18), order="C", device="cpu")],
) -> None:
    """Step filters one after the other, the first at an address and each so many bytes after the
    last: samples (n, 11), dt in s, voltage (n,) V; estimates (n, 30) and variances (n, 18),
    written.
    """

def make_calls(
    address: int,
    calls: Annotated[
        NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    rows: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    numbers: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    std: Annotated[NDArray[numpy.float64], dict(shape=(None, 18), order="C", device="cpu")],
    loads: Annotated[NDArray[numpy.float64], dict(shape=(None, 7, 3), order="C", device="cpu")],
    innovations: Annotated[NDArray[numpy.float64], dict(shape=(None, 12), order="C", device="cpu")]
    | None = None,
) -> int:
    """Make calls of a filter, bytes of the record CALL (n,), and write the results into the row of
    each: numbers (N, 30 or more) and standard deviations (N, 18) of an estimate, and the loads
    (N, 7, 3) of the vehicle's uncertainty; innovations (N, 12): whitened, of the last measured
    pose, and the diagonal of the root of its covariance. Return the number of calls up to a
    quaternion that is no rotation.
    """

FAN_SIZE: int

def wind_formula(name: str, size: int) -> int:
    """Return the address of a wind's formula, steady, waves, jets or grid, whose parameters have a
    size in bytes.

    Raises:
        ValueError: no formula has this name and parameters of this size.
    """

def add_winds(
    calls: Annotated[
        NDArray[numpy.int64], dict(shape=(None, 2), order="C", device="cpu", writable=False)
    ],
    time: float,
    points: Annotated[
        NDArray[numpy.float64], dict(shape=(3, None), order="C", device="cpu", writable=False)
    ],
    velocities: Annotated[NDArray[numpy.float64], dict(shape=(3, None), order="C", device="cpu")],
) -> None:
    """Add winds, addresses of formula and parameters (winds, 2), at points (3, n) m and a time in s
    to velocities (3, n) m/s, world.
    """

def jet_at(
    fan: int,
    jet: Annotated[
        NDArray[numpy.float64], dict(shape=(2, 137, 151), order="C", device="cpu", writable=False)
    ],
    points: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    winds: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu")],
) -> None:
    """Write the mean wind (n, 3) m/s of the fan at an address at points (n, 3) m of the world;
    `jet` (2, 137, 151) are the tables of axial and radial speed.
    """

def jet_wrench(
    fan: int,
    jet: Annotated[
        NDArray[numpy.float64], dict(shape=(2, 137, 151), order="C", device="cpu", writable=False)
    ],
    position: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    rotation: Annotated[
        NDArray[numpy.float64], dict(shape=(3, 3), order="C", device="cpu", writable=False)
    ],
    velocity: Annotated[
        NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu", writable=False)
    ],
    com: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    wrench: Annotated[NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu")],
) -> None:
    """Write force N and torque Nm about the centre of mass (6,), world, of the wind on a vehicle in
    front of the fan at an address: position (3,) m, rotation (3, 3) from body to world, velocity
    (6,) m/s, world, and rad/s, body, centre of mass (3,) m.
    """
