"""The compiled core: what is computed at every step."""

from collections.abc import Sequence
from typing import Annotated, Final, overload

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

@overload
def drive(
    address: int,
    speeds: Annotated[
        NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)
    ],
    dt: float,
    voltage: float,
) -> None:
    """Let the rotors of a filter's model deliver over dt s at logged speeds (4,), rad/s."""

@overload
def drive(
    address: int,
    rotor_speeds: Annotated[
        NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)
    ],
    dt: float,
    voltage: float,
) -> None:
    """Work out in the model at an address what its rotors deliver over dt s at the logged rotor
    speeds (4,), rad/s; voltage in V, 0 where it is not known.
    """

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
    aloft: Annotated[
        NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    spread: float,
    keeps_velocity: bool,
    reaction: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    path: Annotated[NDArray[numpy.float64], dict(shape=(None, None, 13), order="C", device="cpu")],
) -> None:
    """Run a model along a flight of states (n, 13), and a copy of it from each start, a row;
    write the copy's states (starts, ahead, 13), a period (s) apart. The rows `aloft` before tell
    the thrust, known to a share of `spread`; 0: as the model's. With keeps_velocity no force
    acts. The reaction (9) of a flight loop turns the body, too; (0): none.
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
    rotation: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3, 3), order="C", device="cpu", writable=False)
    ],
    rotors: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 4), order="C", device="cpu", writable=False)
    ],
    rate: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 3), order="C", device="cpu", writable=False)
    ],
    twist: Annotated[
        NDArray[numpy.float64], dict(shape=(3, 3, 3), order="C", device="cpu", writable=False)
    ],
    acting: Sequence[
        tuple[
            float,
            Annotated[NDArray[numpy.float64], dict(device="cpu", writable=False)],
            Annotated[NDArray[numpy.float64], dict(device="cpu", writable=False)],
            int,
        ]
    ],
    moved: Sequence[
        tuple[
            float,
            Annotated[NDArray[numpy.float64], dict(device="cpu", writable=False)],
            Annotated[NDArray[numpy.float64], dict(device="cpu", writable=False)],
            int,
        ]
    ],
    jumps: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6, 3), order="C", device="cpu", writable=False)
    ],
    shares: Annotated[
        NDArray[numpy.float64], dict(shape=(6, 3, None), order="C", device="cpu", writable=False)
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
    whiten: Annotated[
        NDArray[numpy.float64], dict(shape=(6, 6), order="C", device="cpu", writable=False)
    ],
    counted: Annotated[
        NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    state: Annotated[NDArray[numpy.float64], dict(shape=(6, 3, None), order="C", device="cpu")],
    out: Annotated[NDArray[numpy.float64], dict(shape=(None, 6, None), order="C", device="cpu")],
) -> None:
    """Write rows (m, 6, c + 1) of the counted samples: the whitened change of the innovations'
    predictions with a unit of each column, and the innovations. Columns are products: scale,
    x (n,), y (n, k), and their first channel.
    """

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

def run_sections(
    x: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    sections: Annotated[
        NDArray[numpy.float64], dict(shape=(None, 6), order="C", device="cpu", writable=False)
    ],
    steady: bool,
    ways: int,
) -> None:
    """Run second-order sections (m, 6) over columns (n, k) in place: forwards, and backwards where
    there are two ways; steady: as if the first row of a way had lasted, else from rest.
    """

def filter_both_ways(
    x: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    order: int,
    share_of_nyquist: float,
    high: bool,
) -> None:
    """Run a Butterworth low-pass or high-pass over columns (n, k) in place, both ways."""

def differentiate(
    x: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    period: float,
    order: int,
    out: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
) -> None:
    """Write the derivative of columns (n, k) by the polynomial through five samples."""

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

MODEL_SIZE: int

def effect_addresses(name: str, kind: str) -> tuple[int, int]:
    """Return the addresses of an effect's equation and of its `advance`, C functions of four
    arrays of doubles; 0 where the library has none of this kind: wrench, rotor input,
    sensing.
    """

def call_effect(
    address: int,
    c: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
    vehicle: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
    third: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
    fourth: Annotated[NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu")],
) -> None:
    """Call the effect at an address with its four arrays, in place."""

def set_jet_table(
    axial: Annotated[
        NDArray[numpy.float64], dict(shape=(137, 151), order="C", device="cpu", writable=False)
    ],
    radial: Annotated[
        NDArray[numpy.float64], dict(shape=(137, 151), order="C", device="cpu", writable=False)
    ],
) -> None:
    """Give the effect fan_jet the axial and radial speeds (137, 151) of a jet with u0 = 1."""

def apply_effects(
    address: int,
    x: Annotated[
        NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    rotation: Annotated[
        NDArray[numpy.float64], dict(shape=(3, 3), order="C", device="cpu", writable=False)
    ],
) -> None:
    """Write in the model at an address the wrench of its effects at a state: x begins with
    position m, quaternion, velocity m/s (world) and rate rad/s (body); rotation (3, 3) is from
    body to world.
    """

def rewrite_sample(address: int, dt: float, parts: int, direction: int) -> None:
    """Change rotor speeds and pose in the sample of the model at an address from truth to report
    (direction 1) or back (-1); parts: 1 position, 2 attitude, 4 rotor speeds.
    """

FILTER_SIZE: int

def step(address: int, parts: int, dt: float, voltage: float) -> int:
    """Predict the filter at an address over dt s if that is positive, then correct with the
    parts (1 position, 2 attitude) of the sample in its memory that were measured; voltage in
    V. The memory then also has the pose's whitened innovation.

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

def matrix_of(
    q: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)],
    out: Annotated[NDArray[numpy.float64], dict(shape=(3, 3), order="C", device="cpu")],
) -> None:
    """Write the matrix (3, 3) from body to world of a quaternion (4,)."""

def multiply(
    a: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)],
    b: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)],
    out: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu")],
) -> None:
    """Write Hamilton's product a * b (4,) of two quaternions; out is neither of them."""

def quaternion_of(
    rho: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    out: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu")],
) -> None:
    """Write the quaternion (4,) of modified Rodrigues parameters (3,)."""

def attitude_error(
    q: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)],
    reference: Annotated[
        NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)
    ],
    out: Annotated[NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu")],
) -> None:
    """Write the modified Rodrigues parameters (3,), world, that take a quaternion to q."""

def turn_body(
    q: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu", writable=False)],
    rate: Annotated[
        NDArray[numpy.float64], dict(shape=(3), order="C", device="cpu", writable=False)
    ],
    dt: float,
    out: Annotated[NDArray[numpy.float64], dict(shape=(4), order="C", device="cpu")],
) -> None:
    """Write q turned at a body rate (3,), rad/s, for dt s."""

class LoopBlocks:
    def __init__(
        self,
        like: int,
        count: int,
        follows: bool,
        moves: bool,
        places: Annotated[
            NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
    ) -> None:
        """Closed loops side by side, one to each lane of `count` blocks, all like the one at an
        address. follows: whether the set point is a row of the reference; moves: whether
        commands are velocities of the set point; places (n,) of commands in the set point, or
        in the action. ValueError: an effect of a vehicle is written in Python.
        """

    def __len__(self) -> int: ...

    lanes: Final[int] = ...
    """(arg: object, /) -> int"""

    def put(self, block: int, first: int, last: int, address: int) -> None:
        """Let lanes `first` to `last - 1` of a block stand where the loop at an address stands."""

    def take(self, block: int, lane: int, other: LoopBlocks, source: int) -> None:
        """Let a lane of a block stand where the same lane of another's block stands."""

    def fly(
        self,
        begin: int,
        end: int,
        slots: Annotated[
            NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        scene: Scene,
        kind: int,
        ticks: int,
        size: int,
        streams: Streams,
        winds: Annotated[
            NDArray[numpy.int64],
            dict(shape=(None, None, 2), order="C", device="cpu", writable=False),
        ],
        wind_counts: Annotated[
            NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
    ) -> None:
        """Fly blocks `begin` to `end - 1` for some ticks of `size` unit normals each, from the
        environments' streams. slots (lanes,): the environment in each lane; -1: no flight.
        kind: of the commands; winds (n, most, 2): calls of each environment's, and their
        number (n,).
        """

    def look(
        self,
        which: Annotated[
            NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        scene: Scene,
    ) -> None:
        """Let environments of which (n,) with numbers too large start over; write all rows."""

    def view(self, name: str) -> NDArray[numpy.float64]:
        """Return a field (blocks, size, lanes) of the memory: qpos, qvel, xfrc, speeds, sum,
        actuator_late or pose_late.
        """

    def fly_freely(self, dt: float, steps: int) -> None:
        """Carry the free bodies on by steps of dt s at the wrench in xfrc."""

    def state(self) -> bytes:
        """Return all memory."""

    def restore(self, state: bytes, like: int) -> None:
        """Stand where the blocks of a state stood, of loops like the one at an address."""

class SingleLoopBlocks:
    def __init__(
        self,
        like: int,
        count: int,
        follows: bool,
        moves: bool,
        places: Annotated[
            NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
    ) -> None:
        """Closed loops side by side, one to each lane of `count` blocks, all like the one at an
        address. follows: whether the set point is a row of the reference; moves: whether
        commands are velocities of the set point; places (n,) of commands in the set point, or
        in the action. ValueError: an effect of a vehicle is written in Python.
        """

    def __len__(self) -> int: ...

    lanes: Final[int] = ...
    """(arg: object, /) -> int"""

    def put(self, block: int, first: int, last: int, address: int) -> None:
        """Let lanes `first` to `last - 1` of a block stand where the loop at an address stands."""

    def take(self, block: int, lane: int, other: SingleLoopBlocks, source: int) -> None:
        """Let a lane of a block stand where the same lane of another's block stands."""

    def fly(
        self,
        begin: int,
        end: int,
        slots: Annotated[
            NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        scene: Scene,
        kind: int,
        ticks: int,
        size: int,
        streams: Streams,
        winds: Annotated[
            NDArray[numpy.int64],
            dict(shape=(None, None, 2), order="C", device="cpu", writable=False),
        ],
        wind_counts: Annotated[
            NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
    ) -> None:
        """Fly blocks `begin` to `end - 1` for some ticks of `size` unit normals each, from the
        environments' streams. slots (lanes,): the environment in each lane; -1: no flight.
        kind: of the commands; winds (n, most, 2): calls of each environment's, and their
        number (n,).
        """

    def look(
        self,
        which: Annotated[
            NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        scene: Scene,
    ) -> None:
        """Let environments of which (n,) with numbers too large start over; write all rows."""

    def view(self, name: str) -> NDArray[numpy.float32]:
        """Return a field (blocks, size, lanes) of the memory: qpos, qvel, xfrc, speeds, sum,
        actuator_late or pose_late.
        """

    def fly_freely(self, dt: float, steps: int) -> None:
        """Carry the free bodies on by steps of dt s at the wrench in xfrc."""

    def state(self) -> bytes:
        """Return all memory."""

    def restore(self, state: bytes, like: int) -> None:
        """Stand where the blocks of a state stood, of loops like the one at an address."""

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

    Of F fields: encodings and predictors (6, F) of I, P, S, G, H and no frames, their counts of
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

def read_text_rows(
    text: bytes,
    begin: int,
    separator: str,
    slots: Annotated[
        NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    columns: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    row: int,
) -> tuple[int, int]:
    """Read the lines of a text table from byte `begin` on: field i of a line is put into
    columns (K, N), line slots[i] of them, from row `row` on; none below 0. Reading ends
    before a line of another number of fields, with quotation marks, without any number, or
    with a field that is no plain number. Return how many rows and bytes were read.
    """

OBSERVER_SIZE: int

def step_extended(address: int, parts: int, dt: float, voltage: float) -> int:
    """Do what `step` does with an extended Kalman filter."""

def step_extended_address() -> int:
    """Return the address of `step_extended`: a C function with the same arguments."""

def start_observer(filter: int, observer: int) -> None:
    """Start an observer at the pose and twist of the state of a filter's memory."""

def step_observer(filter: int, observer: int, parts: int, dt: float, voltage: float) -> int:
    """Carry an observer dt s on, its period, with the parts (1 position, 2 attitude) of the
    sample in the filter's memory that were measured; voltage in V. Return the parts that
    could be used, or -1 if the quaternion is no rotation.
    """

FLIGHT_ROW_SIZE: int

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

LOOP_SIZE: int

PLANT_SIZE: int

WORLD_SIZE: int

def run_ticks(
    address: int,
    path: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    noise: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
) -> None:
    """Run a tick of the loop at an address for each row of noise (n, size), unit normals; path
    (m, 2): the fan's y and height in m, tick by tick. Winds and stages of a user's own do
    not run.
    """

def run_stage(
    address: int,
    stage: int,
    path: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    noise: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    k: int,
) -> None:
    """Run one stage of tick k: 0 wind, 1 sense, 2 estimate, 3 steer, 4 actuate, 5 the
    accelerometer, 6 move.
    """

def is_healthy(address: int) -> bool:
    """Return whether the loop's estimate is finite, and each velocity a vehicle's."""

def no_time() -> int:
    """Return the address of a clock for MuJoCo that stands still."""

def limit(
    seen: Annotated[
        NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu", writable=False)
    ],
    limits: Annotated[
        NDArray[numpy.float32], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    scales: Annotated[
        NDArray[numpy.float32], dict(shape=(None,), order="C", device="cpu", writable=False)
    ],
    si: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order="C", device="cpu")],
    out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order="C", device="cpu")],
) -> None:
    """Write frames (n, k) within limits (k,) as they are into si, and over scales (k,) into out;
    0 where a number is not finite.
    """

class Streams:
    """NumPy's generators of n environments."""

    def __init__(self, count: int) -> None: ...
    def put(self, n: int, generator: object) -> None:
        """Let environment n draw from a numpy.random.Generator."""

    def draw(
        self,
        n: int,
        out: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
    ) -> None:
        """Draw unit normals out (m, k), as `standard_normal(out=out)` does."""

class Scene:
    """The arrays of n episodes, a row each (envs/state.py)."""

    def __init__(
        self,
        ticks: Annotated[NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu")],
        decisions: Annotated[NDArray[numpy.int64], dict(shape=(None,), order="C", device="cpu")],
        paths: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
        heights: Annotated[
            NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")
        ],
        references: Annotated[
            NDArray[numpy.float64], dict(shape=(None, None, None), order="C", device="cpu")
        ],
        commands: Annotated[
            NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")
        ],
        actions: Annotated[
            NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")
        ],
        last_actions: Annotated[
            NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")
        ],
        broken: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu")],
        rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order="C", device="cpu")],
        flying: Annotated[NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu")],
    ) -> None: ...
    def take(
        self,
        wanted: Annotated[
            NDArray[numpy.float64],
            dict(shape=(None, None), order="C", device="cpu", writable=False),
        ],
        which: Annotated[
            NDArray[numpy.bool_], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        scale: float,
        hover: Annotated[
            NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        below: Annotated[
            NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
        above: Annotated[
            NDArray[numpy.float64], dict(shape=(None,), order="C", device="cpu", writable=False)
        ],
    ) -> bool:
        """Write actions (n, size) over scale, within -1 to 1, and their commands into the episodes
        which (n,). Return whether all numbers are finite; nothing is written otherwise.
        """

    def gather(self, n: int, address: int) -> None:
        """Write row n from the loop at an address."""

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
