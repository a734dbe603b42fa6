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

def acting_wrench(
    model: int,
    period: float,
    speeds: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu", writable=False)
    ],
    voltage: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    position: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    rotation: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3, 3), order="C", device="cpu", writable=False)
    ],
    velocity: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    rate: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    turning: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    mass: float,
    inertia: Annotated[
        NDArray[numpy.float64], dict(shape=(3, 3), order="C", device="cpu", writable=False)
    ],
    out: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu")],
) -> None:
    """Write the force (N, world) and torque (Nm, body) of a model's accelerations along a flight,
    for a body of this mass and inertia, at each sample (n, 6); turning: measured angular
    acceleration (n, 3) rad/s2.
    """

def undo_sensing(
    model: int,
    t: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    seen: Annotated[
        NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    samples: Annotated[NDArray[numpy.float64], dict(shape=(None, 11), order="C", device="cpu")],
) -> None:
    """Bring samples (n, 11), rotor speeds and pose, back to the truth in place; rows `seen` have
    a pose.
    """

def predict_flight(
    model: int,
    t: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    speeds: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu", writable=False)
    ],
    voltage: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    states: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 13), order="C", device="cpu", writable=False)
    ],
    starts: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    period: float,
    keeps_velocity: bool,
    path: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 13), order="C", device="cpu")],
) -> None:
    """Run a model along a flight of states (n, 13), and a copy of it from each start, a row;
    write the copy's states (starts, ahead, 13), a period (s) apart. With keeps_velocity no
    force acts.
    """

def choose_likeliest(
    last: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    posed: Annotated[
        NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    numbers: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    innovations: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 12), order="C", device="cpu", writable=False)
    ],
    states: Annotated[NDArray[numpy.float64], dict(shape=(None, 13), order="C", device="cpu")],
    best: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
) -> None:
    """Write the state (n, 13) after the `last` of a filter's calls of each row, and the
    log-likelihood (n,) of the poses so far, where this is larger than of the filters before.
    Calls: `posed` with a pose, numbers (calls, 13 or more), innovations (calls, 12).
    """

def run_causal_filter(
    model: int,
    period: float,
    speeds: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu", writable=False)
    ],
    voltage: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    position: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    quaternion: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu", writable=False)
    ],
    begun: Annotated[
        NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu", writable=False)
    ],
    gain: Annotated[
        NDArray[numpy.float64], dict(shape=(6, 3, 2), order="C", device="cpu", writable=False)
    ],
    keep: Annotated[
        NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu", writable=False)
    ],
    known: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6, 3), order="C", device="cpu", writable=False)
    ],
    at_position: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu")],
    at_rotation: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3, 3), order="C", device="cpu")
    ],
    at_velocity: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu")],
    at_rate: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu")],
    acceleration: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu")],
    rotors: Annotated[NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu")],
    model_alone: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu")],
    predicted: Annotated[NDArray[numpy.float64], dict(shape=(None, 7), order="C", device="cpu")],
    heading: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order="C", device="cpu")],
    innovations: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu")],
    disturbance: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu")],
) -> None:
    """Run the causal filter of a model over poses; write the fields of its track."""

def sensitivities(
    period: float,
    gain: Annotated[
        NDArray[numpy.float64], dict(shape=(6, 3, 2), order="C", device="cpu", writable=False)
    ],
    keep: Annotated[
        NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu", writable=False)
    ],
    heading: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 2), order="C", device="cpu", writable=False)
    ],
    pull: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3, 2), order="C", device="cpu", writable=False)
    ],
    rate: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    gyration: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3, 3), order="C", device="cpu", writable=False)
    ],
    acting: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6, None), order="C", device="cpu", writable=False)
    ],
    moved: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6, None), order="C", device="cpu", writable=False)
    ],
    jumps: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6, None), order="C", device="cpu", writable=False)
    ],
    jump_state: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    slopes: Annotated[
        NDArray[numpy.float64], dict(shape=(6, 7, None), order="C", device="cpu", writable=False)
    ],
    innovations: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu", writable=False)
    ],
    disturbance: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu", writable=False)
    ],
    state: Annotated[NDArray[numpy.float64], dict(shape=(6, 3, None), order="C", device="cpu")],
    out: Annotated[NDArray[numpy.float64], dict(shape=(None, 6, None), order="C", device="cpu")],
) -> None:
    """Write the change of the innovations' predictions (n, 6, c) with a unit of each column."""

def evidence(
    normal: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    right: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    low: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    high: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    mode: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
    std: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
) -> float:
    """Return the logarithm of the evidence of n columns of a quadratic log-likelihood; write the
    mode of the posterior and its standard deviations (n,). NaN: no prior tells columns apart.
    """

def bounded_mode(
    normal: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    right: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    low: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    high: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    mode: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
) -> bool:
    """Write the maximum (n,) of `right @ x - x @ normal @ x / 2` within bounds; return whether
    there is one.
    """

def low_pass(
    x: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    section: Annotated[
        NDArray[numpy.float64], dict(shape=(6), order="C", device="cpu", writable=False)
    ],
    start: Annotated[
        NDArray[numpy.float64], dict(shape=(2), order="C", device="cpu", writable=False)
    ],
) -> None:
    """Run a second-order section (6,) over columns (n, k) in place, forwards and backwards;
    start (2,): the memory of a one.
    """

def level_attitude(
    gyro: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    force: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    dt: float,
    time: float,
    start: Annotated[
        NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)
    ],
    out: Annotated[NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu")],
) -> None:
    """Write the attitude (n, 4) integrated from the gyro (n, 3) and levelled over `time` s by the
    specific force (n, 3), both every dt s.
    """

def smooth_inertial_motion(
    F: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 15, 15), order="C", device="cpu", writable=False)
    ],
    defect: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 15), order="C", device="cpu", writable=False)
    ],
    noise: Annotated[
        NDArray[numpy.float64], dict(shape=(15), order="C", device="cpu", writable=False)
    ],
    knots: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    firsts: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    late: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    off: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    variances: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    x: Annotated[NDArray[numpy.float64], dict(shape=(None, 15), order="C", device="cpu")],
    std: Annotated[NDArray[numpy.float64], dict(shape=(None, 15), order="C", device="cpu")],
) -> bool:
    """Smooth an error state (m, 15) with steps F (m - 1, 15, 15) and defects between knots;
    x and std hold the prior in their first rows. Return whether all covariances are regular.
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

def decode_blackbox(
    data: Annotated[
        NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    begin: int,
    encodings: Annotated[
        NDArray[numpy.int64], dict(shape=(6, None), order="C", device="cpu", writable=False)
    ],
    predictors: Annotated[
        NDArray[numpy.int64], dict(shape=(6, None), order="C", device="cpu", writable=False)
    ],
    counts: Annotated[
        NDArray[numpy.int64], dict(shape=(5), order="C", device="cpu", writable=False)
    ],
    intervals: Annotated[
        NDArray[numpy.int64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    constants: Annotated[
        NDArray[numpy.int64], dict(shape=(257), order="C", device="cpu", writable=False)
    ],
    places: Annotated[
        NDArray[numpy.int64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    keep: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    rows: Annotated[NDArray[numpy.int64], dict(shape=(None, None), order="C", device="cpu")],
) -> tuple[int, int]:
    """Decode the main frames of a blackbox, its bytes up to the log's end, from `begin` on.

    Of F fields: encodings and predictors (6, F) of I, P, S, G and H frames and of none, their counts of
    fields (5,), intervals (3,) of I frames and of P frames as a fraction, in loops; the
    constants (257,) of the predictors; the places (3,) of the fields loopIteration, time and
    motor[0], -1 for none. The wanted fields, `keep` (K,), are written into rows (N, K).
    Return how many frames, of N at most, were decoded, and how many were not.
    """

def walk_dataflash(
    data: Annotated[
        NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    places: Annotated[NDArray[numpy.int32], dict(shape=(None,), order="C", device="cpu")],
    kinds: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order="C", device="cpu")],
) -> tuple[int, int]:
    """Write the places and types of all messages of a DataFlash log, at most one for each three
    bytes. Return how many they are, and how many bytes they take.
    """
