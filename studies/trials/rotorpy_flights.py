"""Flights of RotorPy's Hummingbird: another group's dynamics, controller and aerodynamics, logged in our conventions.

RotorPy: Folk, Paulos and Kumar, *RotorPy: A Python-based Multirotor Simulator with Aerodynamics for Education and
Research*, 2023 (``pip install rotorpy``). It is imported where it is needed only.

Its laws (``Multirotor.compute_body_wrench``) against those of our library, at the airspeed u_i of rotor i in body axes:

==========  ==========================================  ==================================================
RotorPy     its law                                     ours
==========  ==========================================  ==================================================
``k_eta``   thrust k_eta W^2                            ``k``, the same
``k_m``     yaw torque direction * k_m W^2              ``p``, with ``spin`` = -direction
``k_d``     F_i = -W_i diag(k_d, k_d, 0) u_i            rotor_drag, kdx = kdy = k_d
``k_z``     F_i = -W_i k_z u_iz e_z                     inflow_thrust, kz = k_z
``k_h``     F_i = k_h (u_ix^2 + u_iy^2) e_z             translational_lift, kh = k_h
``k_flap``  M_i = -k_flap W_i (u_i x e_z)               flapping_moment, kflap = k_flap; 0 for the Hummingbird
``c_D``     F = -abs(u) diag(c_Dx, c_Dy, c_Dz) u        body_drag, cx, cy, cz = c_D; dx = dy = dz = 0
==========  ==========================================  ==================================================

There is no factor or sign between them: its centre of mass is the geometric centre, world z is up, and attitude is body to
world. Only orders differ: its quaternion has the scalar last, and its rotors go clockwise from the front left (1 front-left,
2 front-right, 3 rear-right, 4 rear-left), ours counter-clockwise.
"""  # noqa: E501

import functools
import math
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from windwrench.dynamics.vehicle import EffectSetting, Mocap, Vehicle
from windwrench.envs.plant import TICK
from windwrench.envs.recording import draw_trajectory
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.errors import InputError

Array = NDArray[np.float64]

_ORDER = [0, 3, 2, 1]  # of RotorPy's rotors, as ours
_EIGHT_BITS = 255
SIGMA_POSITION, SIGMA_ATTITUDE = 0.001, 0.005  # m, rad: of one pose at noise 1


def available() -> bool:
    """Whether RotorPy is installed."""
    return find_spec("rotorpy") is not None


@functools.cache
def _parameters() -> dict[str, Any]:
    """Return RotorPy's own parameters of the Hummingbird.

    Raises:
        InputError: RotorPy is not installed.
    """
    if not available():
        raise InputError("RotorPy is not installed; expected pip install rotorpy")
    from rotorpy.vehicles.hummingbird_params import quad_params

    return dict(quad_params)


def hummingbird_vehicle(eight_bit: bool = False) -> Vehicle:
    """Return RotorPy's Hummingbird as its parameter file states it, without aerodynamics.

    ``eight_bit``: rotor speeds are logged in 255 steps.

    Raises:
        InputError: RotorPy is not installed.
    """
    c = _parameters()
    positions = np.array(list(c["rotor_pos"].values()), dtype=np.float64)[_ORDER]
    inertia = np.array(
        [
            [c["Ixx"], c["Ixy"], c["Ixz"]],
            [c["Ixy"], c["Iyy"], c["Iyz"]],
            [c["Ixz"], c["Iyz"], c["Izz"]],
        ]
    )
    return Vehicle(
        name="rotorpy_hummingbird",
        mass=c["mass"],
        inertia=inertia,
        arm_l=float(np.abs(positions[:, :2]).mean()),
        k=np.full(4, c["k_eta"]),
        p=np.full(4, c["k_m"]),
        rotor_radius=c["rotor_radius"],
        omega_lsb=c["rotor_speed_max"] / _EIGHT_BITS if eight_bit else 0.0,
        omega_max=float(c["rotor_speed_max"]),
        # RotorPy's directions are of the torque on the body
        spin=-np.asarray(c["rotor_directions"], dtype=np.float64)[_ORDER],
        rotor_positions=positions,
        mocap=Mocap(1.0 / TICK, SIGMA_POSITION, SIGMA_ATTITUDE),
    )


def hummingbird_aero() -> dict[str, dict[str, float]]:
    """Return RotorPy's aerodynamics of the Hummingbird as effects of our library: their
    coefficients by name.

    Raises:
        InputError: RotorPy is not installed.
    """
    c = _parameters()
    effects = {
        "rotor_drag": {"kdx": c["k_d"], "kdy": c["k_d"]},
        "inflow_thrust": {"kz": c["k_z"]},
        "translational_lift": {"kh": c["k_h"]},
        "body_drag": {"cx": c["c_Dx"], "cy": c["c_Dy"], "cz": c["c_Dz"]},
        "flapping_moment": {"kflap": c["k_flap"]},
    }
    return {name: values for name, values in effects.items() if any(values.values())}


def aero_settings() -> tuple[EffectSetting, ...]:
    """Return ``hummingbird_aero`` as the effects of a vehicle."""
    return tuple(EffectSetting(name, values) for name, values in hummingbird_aero().items())


def rotorpy_flight(
    trajectory: str = "excite",
    seconds: float = 60.0,
    seed: int = 0,
    aero: bool = True,
    noise: float = 1.0,
    eight_bit: bool = False,
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FlightLog:
    """Fly RotorPy's Hummingbird with RotorPy's controller, which sees the truth, at 200 Hz; return
    the log.

    Args:
        trajectory: one of ``envs.recording.TRAJECTORIES``.
        seconds: length of the log.
        seed: of the trajectory and the noise; the same arguments give the same log.
        aero: whether RotorPy's aerodynamics act.
        noise: factor on 1 mm and 5 mrad of one pose.
        eight_bit: log rotor speeds in 255 steps.
        wind: m/s, steady, world; it blows only where ``aero`` is on.

    Returns:
        The log. Pose, the true rotor speeds, and force and torque beyond rotors and weight are all
            those at the instant of
        the sample.

    Raises:
        InputError: RotorPy is not installed, the trajectory is unknown, a length is out of range,
            or it crashed.
    """
    if not TICK * 20 <= seconds <= 7200 or not 0.0 <= noise < math.inf:
        raise InputError(
            f"rotorpy_flight: seconds must lie between {TICK * 20:g} and 7200 and noise be at "
            f"least 0, got "
            f"{seconds:g} and {noise:g}"
        )
    parameters, vehicle = _parameters(), hummingbird_vehicle(eight_bit)
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.multirotor import Multirotor

    rng = np.random.default_rng(seed)
    t = TICK * np.arange(round(seconds / TICK) + 1, dtype=np.float64)
    setpoints = draw_trajectory(trajectory, rng, t, vehicle.ceiling_z)
    heading = Rotation.from_euler("z", setpoints[0, 9]).as_quat()
    state: dict[str, Any] = {
        "x": setpoints[0, :3].copy(),
        "v": np.zeros(3),
        "q": heading,
        "w": np.zeros(3),
        "wind": np.array(wind, float),
        "rotor_speeds": np.full(4, vehicle.hover_rate),
    }
    # RotorPy's integrator, spared the search for its first step
    simulator = Multirotor(parameters, state, aero=aero, integrator_kwargs={"first_step": TICK})
    controller = SE3Control(parameters)
    position, quaternion, speeds = (
        np.empty((len(t), 3)),
        np.empty((len(t), 4)),
        np.empty((len(t), 4)),
    )
    wrench = np.zeros((len(t), 6))
    for k, s in enumerate(setpoints):
        if k > 0:
            wanted = {
                "x": setpoints[k - 1, :3],
                "x_dot": setpoints[k - 1, 3:6],
                "x_ddot": setpoints[k - 1, 6:9],
                "yaw": setpoints[k - 1, 9],
                "yaw_dot": setpoints[k - 1, 10],
            }
            command = controller.update(t[k - 1], state, wanted)
            state = simulator.step(state, command, TICK)
        position[k], quaternion[k], speeds[k] = state["x"], state["q"], state["rotor_speeds"]
        if not np.linalg.norm(position[k] - s[:3]) < 10.0:
            raise InputError(
                f"rotorpy_flight: the Hummingbird left its path after {t[k]:.1f} s of {trajectory}"
            )
        if aero:
            wrench[k] = _beyond_rotors(simulator, vehicle, state)
    if eight_bit:
        speeds = vehicle.omega_lsb * np.round(speeds / vehicle.omega_lsb)
    error = Rotation.from_rotvec(noise * SIGMA_ATTITUDE * rng.standard_normal((len(t), 3)))
    seen = (error * Rotation.from_quat(quaternion)).as_quat(scalar_first=True, canonical=True)
    return FlightLog(
        t,
        position + noise * SIGMA_POSITION * rng.standard_normal((len(t), 3)),
        seen,
        speeds[:, _ORDER],
        force=wrench[:, :3],
        torque=wrench[:, 3:],
        name=f"rotorpy_{'aero' if aero else 'plain'}_{trajectory}_{seed}",
        source="flown in RotorPy",
    )


def _beyond_rotors(simulator: Any, vehicle: Vehicle, state: dict[str, Any]) -> Array:
    """Return force and torque (6,) in the world frame of RotorPy's aerodynamics at a state."""
    rotation = Rotation.from_quat(state["q"]).as_matrix()
    airspeed = rotation.T @ (state["v"] - state["wind"])
    force, torque = simulator.compute_body_wrench(state["w"], state["rotor_speeds"], airspeed)
    bare = vehicle.rotor_wrench(state["rotor_speeds"][_ORDER])
    return np.concatenate(
        [rotation @ (force - [0.0, 0.0, bare[0]]), rotation @ (torque - bare[1:])]
    )
