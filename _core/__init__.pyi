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
