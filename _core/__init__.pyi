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

CONSTANT_GAIN_SIZE: int

def step_with_gain(address: int, parts: int, dt: float, voltage: float) -> int:
    """Do what `step` does with a filter whose gain is constant in steady flight."""

def step_with_gain_address() -> int:
    """Return the address of `step_with_gain`: a C function with the same arguments."""

def hold_still(
    address: int,
    z: Annotated[NDArray[numpy.float64], dict(shape=(11), order="C", device="cpu", writable=False)],
    steps: int,
    voltage: float,
) -> None:
    """Step a filter through periods with one sample (11,), rotor speeds and pose."""

def hover_jacobian(
    address: int,
    voltage: float,
    out: Annotated[NDArray[numpy.float64], dict(shape=(6, 18), order="C", device="cpu")],
) -> None:
    """Write the derivatives (6, 18) of angular (body) and linear acceleration by the error
    state of a filter that hovers at its last rotor speeds; voltage in V.
    """

def drive(
    address: int,
    speeds: Annotated[
        NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)
    ],
    dt: float,
    voltage: float,
) -> None:
    """Let the rotors of a filter's model deliver over dt s at logged speeds (4,), rad/s."""

def move(
    address: int,
    x: Annotated[NDArray[numpy.float64], dict(shape=(20), order="C", device="cpu", writable=False)],
    dt: float,
    out: Annotated[NDArray[numpy.float64], dict(shape=(20), order="C", device="cpu")],
    jacobian: Annotated[NDArray[numpy.float64], dict(shape=(12, 18), order="C", device="cpu")]
    | None = None,
) -> None:
    """Write the state (20,) that follows x (20,) after dt s by a filter's model, as driven, and
    the first 12 rows (12, 18) of the Jacobian of its error state less the identity.
    """

def expected_imu(
    address: int,
    x: Annotated[NDArray[numpy.float64], dict(shape=(20), order="C", device="cpu", writable=False)],
    out: Annotated[NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu")],
) -> None:
    """Write what gyro, rad/s, and accelerometer, m/s2, would measure (6,) without bias in a
    state x (20,), as driven.
    """

ROW_SIZE: int

INNOVATION_SIZE: int

def smooth_block(
    memory: int,
    smoothed: int,
    calls: Annotated[
        NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    numbers: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    std: Annotated[NDArray[numpy.float64], dict(shape=(None, 18), order="C", device="cpu")],
) -> None:
    """Make calls, bytes of the record CALL (n,), of the filter at the address `memory`, and go
    back from the smoothed estimate after them to the one before, both at the address
    `smoothed`. Write numbers (n, 30 or 354) and standard deviations (n, 18) of each.
    """

def write_smoothed(
    address: int,
    row: int,
    numbers: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    std: Annotated[NDArray[numpy.float64], dict(shape=(None, 18), order="C", device="cpu")],
) -> None:
    """Write the smoothed estimate at an address into a row of numbers and deviations."""

def link_back(
    P: Annotated[
        NDArray[numpy.float64], dict(shape=(18, 18), order="C", device="cpu", writable=False)
    ],
    C: Annotated[
        NDArray[numpy.float64], dict(shape=(18, 18), order="C", device="cpu", writable=False)
    ],
    after: Annotated[
        NDArray[numpy.float64], dict(shape=(18, 18), order="C", device="cpu", writable=False)
    ],
    G: Annotated[NDArray[numpy.float64], dict(shape=(18, 18), order="C", device="cpu")],
    K: Annotated[NDArray[numpy.float64], dict(shape=(18, 18), order="C", device="cpu")],
) -> None:
    """Write the smoother's gain, transposed, and the covariance of the estimate before, given
    the one after, from P before a prediction, cross covariance C and P after; all (18, 18).
    """

def judge_rows(
    address: int,
    rows: Annotated[
        NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    log_inlier: float,
    log_outlier: float,
    out: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu")],
) -> None:
    """Carry a filter along bytes of the record ROW (n,), and write those of INNOVATION (n,).
    Logarithms of the chance of a pose that is no outlier, and of an outlier's density.
    """

def variances_along(
    factors: Annotated[
        NDArray[numpy.float64], dict(shape=(9), order="C", device="cpu", writable=False)
    ],
    loads: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 7, 3), order="C", device="cpu", writable=False)
    ],
    out: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu")],
) -> None:
    """Write the variances (n, 6) of torque and force by the vehicle's uncertainty, at loads
    (n, 7, 3).
    """
