"""The model of each effect against its formula, written out here once more."""

from dataclasses import replace
from itertools import pairwise
from math import nan, pi

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from tests.support.outcomes import refused
from tests.support.vehicles import VEHICLE
from windwrench import _core
from windwrench.dynamics import EffectSetting
from windwrench.dynamics.effects import compile_effects
from windwrench.dynamics.effects.base import STATE
from windwrench.dynamics.mean_jet import jet_table
from windwrench.dynamics.model import MODEL_FIELDS, load_model
from windwrench.envs.fan import Fan, fan_record

PERIOD = 0.005
# a tilted vehicle that moves, turns and has four different rotors
R = Rotation.from_euler("zyx", [2.0, 0.2, -0.3]).as_matrix()
V = np.array([1.5, -0.7, 0.4])
OMEGA = np.array([0.5, -1.0, 2.0])
W = np.array([380.0, 400.0, 420.0, 410.0])


class Model:
    """A vehicle's effects in the core."""

    def __init__(self, vehicle):
        record = np.zeros(1, dtype=MODEL_FIELDS)
        load_model(record[0], vehicle)
        self.memory, self.address = record[0], record.ctypes.data
        self.record = record


def wrench(
    vehicle,
    position=(0.0, 0.0, 0.15),
    wind=(0.0, 0.0, 0.0),
    acceleration=(0.0, 0.0, 0.0, 0.0),
    omega=OMEGA,
    speeds=W,
):
    """Force (world) and torque (body) of a vehicle's effects in the state above."""
    model = Model(vehicle)
    state = model.memory["effect_state"]
    state[:] = nan
    state.view(STATE)["rotor_acceleration"] = acceleration
    model.memory["wind"], model.memory["voltage"] = wind, 11.0
    model.memory["rotors"][:4] = speeds
    x = np.concatenate([position, np.full(4, nan), V, omega])
    _core.apply_effects(model.address, x, np.ascontiguousarray(R))
    out = model.memory["effect_wrench"]
    return out[:3], out[3:]


class Rotors(Model):
    """A vehicle's effects on rotor speeds, called once a period."""

    def __call__(self, speeds, voltage=0.0, dt=PERIOD, time=0.0):
        self.memory["time"] = time
        _core.drive(self.address, np.array(speeds, dtype=float), dt, voltage)
        return self.memory["rotors"][:4].copy()


class Sensing(Model):
    """A vehicle's effects on what is sensed, called once a period."""

    def __init__(self, vehicle, direction):
        super().__init__(vehicle)
        self.direction = int(direction)

    def __call__(self, speeds, position, quaternion, parts=7, dt=PERIOD):
        self.memory["sample"][:11] = np.concatenate([speeds, position, quaternion])
        _core.rewrite_sample(self.address, dt, parts, self.direction)
        sample = self.memory["sample"].copy()
        return sample[:4], sample[4:7], sample[7:11]


def declared(effects):
    """The vehicle with effects: coefficients by their names, by effect."""
    return VEHICLE.with_effects(*(EffectSetting(name, c) for name, c in effects.items()))


def setting(name, **coefficients):
    return declared({name: coefficients})


def offset(com):
    """The effect of a centre of mass (3,) off the geometric centre, m."""
    return EffectSetting("com_offset", dict(zip(("cx", "cy", "cz"), com, strict=True)))


def at_rotors(law, com=(0.0, 0.0, 0.0), wind=(0.0, 0.0, 0.0)):
    """Force (world) and torque (body) of a law: ``law(i, u)`` is the force (3,) in body axes on
    rotor i, which meets the air with u (m/s).
    """
    air = R.T @ (V - wind)
    forces = np.array([law(i, air + np.cross(OMEGA, r)) for i, r in enumerate(VEHICLE.positions)])
    return R @ forces.sum(axis=0), np.cross(VEHICLE.positions - com, forces).sum(axis=0)


def assert_wrench(got, force, torque, rtol=1e-12):
    assert_allclose(got[0], force, rtol=rtol, atol=1e-15)
    assert_allclose(got[1], torque, rtol=rtol, atol=1e-15)


def near_a_plane(distance):
    """The law of Cheeseman and Bennett with rho = 3 at a distance (m) of the geometric centre."""

    def law(i, u):
        away = distance(R @ VEHICLE.positions[i])
        factor = 1 / (1 - 3.0 * (VEHICLE.rotor_radius / (4 * away)) ** 2)
        return np.array([0, 0, VEHICLE.k[i] * W[i] ** 2 * (factor - 1)])

    return law


WIND = np.array([0.5, 2.0, -0.3])


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.01, -0.02, 0.03)])
@pytest.mark.parametrize(
    ("name", "size", "law"),
    [
        (
            "rotor_drag",
            {"kdx": 1.2e-4, "kdy": 0.8e-4},
            lambda i, u: -W[i] * np.array([1.2e-4, 0.8e-4, 0.0]) * u,
        ),
        ("inflow_drag", {"kl": 3e-3}, lambda i, u: -3e-3 * u[2] * u * [1, 1, 0]),
        ("ground_effect", {"rho": 3.0}, near_a_plane(lambda r: 0.15 + r[2])),
        ("ceiling_effect", {"rho": 3.0}, near_a_plane(lambda r: 0.2 - r[2])),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_effect_acts_at_each_rotor(name, size, law, com):
    vehicle = replace(VEHICLE, ceiling_z=0.35)
    got = wrench(vehicle.with_effects(offset(com), EffectSetting(name, size)), wind=WIND)
    assert_wrench(got, *at_rotors(law, com, WIND))
    assert norm(got[1]) > 0.0


BLOWN = np.array([2.0, -1.0, 0.3])  # m/s
TURN = Rotation.from_rotvec([0.03, -0.05, 0])
THRUST = np.array([0.0, 0.0, np.sum(VEHICLE.k * W**2)])
ROTOR_TORQUE = VEHICLE.rotor_wrench(W)[1:]
ACCELERATION = np.array([100.0, -50.0, 20.0, 300.0])


@pytest.mark.parametrize(
    ("effects", "given", "force", "torque"),
    [
        (  # opposes the body rate
            {"rate_damping": {"dx": 1e-3, "dy": 2e-3, "dz": 3e-3}},
            {},
            np.zeros(3),
            -np.array([1e-3, 2e-3, 3e-3]) * OMEGA,
        ),
        (  # the rate of change of the rotors' momentum
            {"rotor_inertia": {"jr": 2e-5}},
            {"acceleration": ACCELERATION},
            np.zeros(3),
            -2e-5 * np.array([0, 0, VEHICLE.spin @ ACCELERATION])
            - np.cross(OMEGA, [0, 0, 2e-5 * (VEHICLE.spin @ W)]),
        ),
        (  # turns the rotors' thrust and their torque about the geometric centre
            {"thrust_axis_tilt": {"ax": 0.03, "ay": -0.05}},
            {},
            R @ (TURN.apply(THRUST) - THRUST),
            TURN.apply(ROTOR_TORQUE)
            - ROTOR_TORQUE
            - np.cross(VEHICLE.com, TURN.apply(THRUST) - THRUST),
        ),
        (  # its change against still air
            {"wind": {"wx": 2.0, "wy": -1.0, "wz": 0.3, "cd": 0.04}},
            {},
            0.04 * (norm(BLOWN - V) * (BLOWN - V) + norm(V) * V),
            np.zeros(3),
        ),
        ({"wind": {"cd": 0.04}}, {}, np.zeros(3), np.zeros(3)),
        (  # in the world, and in the body
            {"constant_force": {"fx": 0.1, "fz": -0.2}, "constant_torque": {"ty": 0.01}},
            {},
            np.array([0.1, 0.0, -0.2]),
            np.array([0.0, 0.01, 0.0]),
        ),
        (  # linear drag, at the geometric centre
            {
                "com_offset": {"cx": 0.01, "cy": -0.02, "cz": 0.03},
                "body_drag": {"dx": 0.1, "dy": 0.2, "dz": 0.3},
            },
            {},
            -R @ (np.array([0.1, 0.2, 0.3]) * (R.T @ V)),
            np.cross([0.01, -0.02, 0.03], np.array([0.1, 0.2, 0.3]) * (R.T @ V)),
        ),
        (  # a vehicle that drifts with the air
            {"rotor_drag": {"kdx": 1e-4, "kdy": 1e-4}},
            {"wind": V, "omega": np.zeros(3)},
            np.zeros(3),
            np.zeros(3),
        ),
    ],
    ids=lambda value: "+".join(value) if isinstance(value, dict) else "",
)
def test_the_wrench_of_an_effect_is_its_formula(effects, given, force, torque):
    assert_wrench(wrench(declared(effects), **given), force, torque, rtol=1e-9)


def test_ground_effect_stays_finite_on_the_floor_and_fades_far_from_it():
    vehicle = setting("ground_effect", rho=3.0)
    thrust = float(np.sum(VEHICLE.k * W**2))
    ceiling = replace(setting("ceiling_effect", rho=3.0), ceiling_z=2.6)
    for touching in (wrench(vehicle, (0, 0, 0.0)), wrench(ceiling, (0, 0, 2.6))):
        assert 0.0 < norm(touching[0]) <= thrust * (1 + 1e-12)
    heights = [norm(wrench(vehicle, (0, 0, z))[0]) for z in (0.15, 0.2, 0.3, 0.5, 1.0, 3.0)]
    assert all(low > high for low, high in pairwise(heights))
    assert heights[-1] < 1e-3 * thrust
    assert_array_equal(wrench(setting("ceiling_effect", rho=3.0), (0, 0, 2.4))[0], 0.0)


def test_the_aerodynamics_of_rotorpy_can_be_said_exactly():
    """As RotorPy's ``Multirotor.compute_body_wrench``, less thrust and yaw torque."""
    k_d, k_z, k_h, k_flap, c_D = 1.19e-4, 2.32e-4, 3.39e-3, 4e-6, np.array([0.5e-2, 0.6e-2, 1e-2])
    air = R.T @ (V - WIND)
    force, torque = at_rotors(
        lambda i, u: -W[i] * np.array([k_d, k_d, k_z]) * u + [0, 0, k_h * (u[0] ** 2 + u[1] ** 2)],
        wind=WIND,
    )
    force = force - R @ (norm(air) * c_D * air)
    for r, rate in zip(VEHICLE.positions, W, strict=True):
        torque = torque - k_flap * rate * np.cross(air + np.cross(OMEGA, r), [0, 0, 1])
    effects = {
        "rotor_drag": {"kdx": k_d, "kdy": k_d},
        "inflow_thrust": {"kz": k_z},
        "translational_lift": {"kh": k_h},
        "flapping_moment": {"kflap": k_flap},
        "body_drag": dict(zip(("cx", "cy", "cz"), c_D, strict=True)),
    }
    assert_wrench(wrench(declared(effects), wind=WIND), force, torque)


def test_rotor_interaction_follows_what_sets_leading_and_following_rotors_apart():
    kp = 5e-4
    kw = 2e-4
    u = R.T @ (V - WIND)
    direction = VEHICLE.positions[:, :2] / norm(VEHICLE.positions[:, :2], axis=1, keepdims=True)
    leads = direction @ u[:2]
    assert leads.min() < 0.0 < leads.max()
    # the induced velocity of momentum theory, and by how far it leans towards the followers
    along = np.hypot(u[0], u[1])
    needed = np.sum(VEHICLE.k * W**2) / (8.0 * 1.2 * pi * VEHICLE.rotor_radius**2)
    induced = brentq(lambda v: v * np.hypot(along, u[2] + v) - needed, 0.0, 50.0)
    back = np.arctan2(along, u[2] + induced)
    lean = 2.0 * induced * np.tan(0.5 * back) / along
    lift = -W @ (kp * lean * leads + kw * np.clip(-leads, 0.0, None))
    force, torque = wrench(setting("rotor_interaction", kp=kp, kw=kw), wind=WIND)
    assert_allclose(force, R @ [0.0, 0.0, lift], rtol=1e-9)
    assert_allclose(torque, 0.0, atol=1e-15)
    # rotors that turn alike lose in the wake alone
    alike = wrench(setting("rotor_interaction", kp=kp), speeds=np.full(4, 400.0))
    assert_allclose(alike, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("rotor_drag", {"kdx": 1e-4, "kdy": 2e-4}),
        ("inflow_thrust", {"kz": 2e-4}),
        ("translational_lift", {"kh": 3e-3}),
        ("ground_effect", {"rho": 3.0}),
    ],
)
def test_a_central_model_is_that_of_rotors_drawn_into_the_centre(name, size):
    drawn = replace(VEHICLE, rotor_positions=np.zeros((4, 3)))
    expected = wrench(drawn.with_effects(*setting(name, **size).effects))
    assert_wrench(wrench(setting(name, **size, central=1.0)), *expected)


def test_wind_blows_through_declared_drag_whatever_its_place_in_the_list():
    drag = {"rotor_drag": {"kdx": 1e-4, "kdy": 1e-4}}
    wind = {"wind": {"wx": 2, "wy": -1, "wz": 0.3}}
    for effects in (drag | wind, wind | drag):
        assert_wrench(wrench(declared(effects)), *wrench(declared(drag), wind=(2.0, -1.0, 0.3)))


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_fan_jet_is_that_of_the_environment_without_gusts(heading):
    fan = Fan(turbulence=0.0)
    com = np.array([0.01, 0.0, -0.02])
    position = np.array([2.1, 0.3, 1.1])
    where = np.array([0.5, -0.4, 0.0])
    out = np.zeros(6)
    turn = Rotation.from_euler("z", heading).as_matrix()
    record = fan_record(fan, VEHICLE.positions, PERIOD)
    _core.jet_wrench(
        record.ctypes.data,
        np.stack(jet_table(fan.radius, fan.hub_radius)),
        position,
        np.ascontiguousarray(turn.T @ R),
        np.concatenate([turn.T @ V, OMEGA]),
        com,
        out,
    )
    place = {"x": where[0], "y": where[1], "z": fan.height, "heading": heading}
    jet = {"u0": fan.speed, "kd": fan.rotor_drag, "area": fan.hull_area} | place
    moved = VEHICLE.with_effects(offset(com), EffectSetting("fan_jet", jet))
    got = wrench(moved, turn @ position + where)
    assert_allclose(got[0], turn @ out[:3], rtol=1e-10)
    assert_allclose(R @ got[1], turn @ out[3:], rtol=1e-10)
    assert norm(out[:3]) > 0.1


def test_motor_lag_is_the_exact_exponential_however_a_time_is_cut_up():
    tau = 0.035
    rng = default_rng(0)
    rotors = Rotors(setting("motor_lag", tau=tau))
    assert_array_equal(rotors([400.0] * 4), [400.0] * 4)  # starts at the first rates
    times = rng.uniform(0.001, 0.01, 20)
    steps = np.array([rotors([500.0, 300.0, 400.0, 450.0], dt=dt) for dt in times])
    share = 1 - np.exp(-np.cumsum(times) / tau)
    expected = 400.0 + share[:, None] * np.array([100.0, -100.0, 0.0, 50.0])
    assert_allclose(steps, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "size", "given", "share"),
    [
        ("battery_sag", {"n": 1.5}, {"voltage": 10.2}, (10.2 / VEHICLE.voltage_ref) ** 1.5),
        ("battery_sag", {"n": 1.5}, {"voltage": VEHICLE.voltage_ref}, 1.0),
        ("battery_sag", {"n": 1.5}, {"voltage": 0.0}, 1.0),  # not known
        ("rotor_efficiency", {"e1": -0.1, "e3": 0.2}, {}, [0.9, 1.0, 1.2, 1.0]),
        ("rotor_efficiency", {"e1": -1.0}, {}, [0.0, 1.0, 1.0, 1.0]),
        ("thrust_scale", {"s": -0.05}, {}, 0.95),
        ("thrust_curvature", {"a": 0.2}, {}, 1 + 0.2 * ((W / VEHICLE.hover_rate) ** 2 - 1)),
        ("thrust_fade", {"rate": 1e-3}, {"time": 30.0}, 0.97),
        ("thrust_fade", {"rate": 0.1}, {"time": 30.0}, 0.1),
    ],
)
def test_the_thrust_that_a_rotor_effect_leaves(name, size, given, share):
    thrust = np.square(Rotors(setting(name, **size))(W, **given) / W)
    assert_allclose(thrust, share + np.zeros(4), rtol=1e-12)


@pytest.mark.parametrize(
    ("d", "dt", "count"),  # the last at a rate that a memory of samples could not hold
    [*((d, dt, 60) for d in (0.0, 0.005, 0.0125, 0.1) for dt in (PERIOD, 0.01)), (0.08, 1e-3, 999)],
)
def test_latency_is_a_pure_delay_between_samples_too(d, dt, count):
    rotors = Rotors(setting("latency", d=d))
    for k in range(count):
        t = k * dt
        out = rotors(400.0 + 10.0 * t * np.array([1, -1, 2, 0]), dt=dt)
        assert_allclose(out, 400.0 + 10.0 * max(t - d, 0.0) * np.array([1, -1, 2, 0]), rtol=1e-12)


@pytest.mark.parametrize("d", [0.0013, 0.0125, 0.0311])
def test_latency_takes_nothing_from_what_falls_between_samples(d):
    rotors = Rotors(setting("latency", d=d))
    phase = 2.0 * pi * 8.0 * PERIOD * np.arange(80)
    out = np.array([rotors(400.0 + 10.0 * np.sin(x + np.arange(4.0))) for x in phase])
    wanted = 400.0 + 10.0 * np.sin(phase[:, None] - 2.0 * pi * 8.0 * d + np.arange(4.0))
    assert_allclose(
        out[20:], wanted[20:], atol=0.02
    )  # a line between two samples would be off by up to 0.08


def test_latency_stays_within_the_samples_where_they_leap():
    rotors = Rotors(setting("latency", d=0.0125))
    out = [rotors([600.0 * (k > 20)] * 4)[0] for k in range(40)]
    assert min(out) == 0.0
    assert max(out) == 600.0


def test_latency_draws_a_line_where_samples_are_six_times_as_far_apart_as_others():
    """A cubic through such four would swing between them."""
    rotors = Rotors(setting("latency", d=0.0125))
    times = np.cumsum([0.03, PERIOD] * 20)
    speeds = 400.0 + 10.0 * default_rng(0).standard_normal(len(times))
    steps = np.diff(times, prepend=0.0)
    late = [rotors(w * np.ones(4), dt=dt)[0] for w, dt in zip(speeds, steps, strict=True)]
    assert_allclose(late, np.interp(times - 0.0125, times, speeds), rtol=1e-12)


POSE = np.array([0.4, -1.2, 1.5])
Q = Rotation.from_matrix(R).as_quat(scalar_first=True)


def rotation_of(q):
    return Rotation.from_quat(q, scalar_first=True)


def test_a_tilted_world_turns_the_pose_and_a_marker_offset_moves_it_with_the_body():
    turn = Rotation.from_rotvec([0.1, -0.05, 0.0])
    speeds, position, q = Sensing(setting("world_tilt", ax=0.1, ay=-0.05), 1.0)(W, POSE, Q)
    assert_array_equal(speeds, W)
    assert_allclose(position, turn.apply(POSE), rtol=1e-12)
    assert_allclose(rotation_of(q).as_matrix(), turn.as_matrix() @ R, atol=1e-14)
    _, position, q = Sensing(setting("marker_offset", mx=0.01, my=0.02, mz=-0.03), 1.0)(W, POSE, Q)
    assert_allclose(position, POSE + R @ [0.01, 0.02, -0.03], rtol=1e-14)
    assert_array_equal(q, Q)


def test_an_attitude_gain_scales_the_tilt_and_nothing_else():
    g = 0.2
    _, position, q = Sensing(setting("attitude_gain", g=g), 1.0)(W, POSE, Q)
    z = rotation_of(q).as_matrix()[:, 2]
    assert np.arccos(z[2]) == pytest.approx((1 + g) * np.arccos(R[2, 2]), rel=1e-12)
    assert_allclose(z[:2] / norm(z[:2]), R[:2, 2] / norm(R[:2, 2]), rtol=1e-12)
    # what is left after the tilt is taken off, the turn about the vertical, is the same
    level = [
        Rotation.from_rotvec(-np.cross([0, 0, 1], up) / norm(up[:2]) * np.arccos(up[2])).as_matrix()
        @ A
        for up, A in ((z, rotation_of(q).as_matrix()), (R[:, 2], R))
    ]
    assert_allclose(level[0], level[1], atol=1e-12)
    assert_array_equal(position, POSE)


SENSING = [
    {"world_tilt": {"ax": 0.1, "ay": -0.05}},
    {"marker_offset": {"mx": 0.01, "mz": -0.03}},
    {"attitude_gain": {"g": 0.2}},
    {"world_tilt": {"ax": 0.1}, "marker_offset": {"my": 0.1}, "attitude_gain": {"g": -0.1}},
]


@pytest.mark.parametrize("effects", SENSING, ids=lambda effects: "+".join(effects))
def test_an_estimator_undoes_a_sensing_effect(effects):
    vehicle = declared(effects)
    reported = Sensing(vehicle, 1.0)(W, POSE, Q)
    assert not np.allclose(np.concatenate(reported[1:]), np.concatenate([POSE, Q]), atol=1e-4)
    _, position, q = Sensing(vehicle, -1.0)(*reported)
    assert_allclose(position, POSE, atol=1e-14)
    assert_allclose(q, Q, atol=1e-14)


@pytest.mark.parametrize("dt", [0.02, -0.02, 0.0125, -0.0125])
def test_a_clock_offset_delays_pose_or_rates_and_an_estimator_the_other(dt):
    clock, undo = (Sensing(setting("clock_offset", dt=dt), way) for way in (1.0, -1.0))
    rng = default_rng(0)
    for k in range(40):
        t = k * PERIOD
        true = 400.0 + t * np.arange(4.0), np.array([t, -t, 1.0]), Rotation.from_euler("z", 3.0 + t)
        speeds, position, q = clock(
            true[0], true[1], rng.choice([-1.0, 1.0]) * true[2].as_quat(scalar_first=True)
        )
        if k > 20:
            assert_allclose(speeds, true[0] - max(-dt, 0.0) * np.arange(4.0), rtol=1e-12)
            assert_allclose(
                position, np.array([t, -t, 1.0]) - max(dt, 0.0) * np.array([1, -1, 0]), atol=1e-12
            )
            yaw = (rotation_of(q) * Rotation.from_euler("z", -3.0 - t)).as_rotvec()
            assert_allclose(yaw, [0, 0, -max(dt, 0.0)], atol=1e-5)
        speeds, position, q = undo(speeds, position, q)
        if k > 20:
            assert_allclose(speeds, true[0] - abs(dt) * np.arange(4.0), rtol=1e-12)
            assert_allclose(
                position, np.array([t, -t, 1.0]) - abs(dt) * np.array([1, -1, 0]), atol=1e-12
            )


def test_a_clock_offset_counts_the_time_through_lost_poses():
    undo = Sensing(setting("clock_offset", dt=-0.02), -1.0)
    for k in range(60):
        t = k * PERIOD
        # rates come every period, poses in every third, each in a call of its own
        undo(W, np.zeros(3), Q, parts=4)
        if k % 3 == 0:
            _, position, _ = undo(W, np.array([t, 0.0, 0.0]), Q, parts=3, dt=0.0)
            assert_allclose(position[0], max(t - 0.02, 0.0), atol=1e-12)


def test_the_body_is_changed_as_declared_and_nothing_else():
    vehicle = compile_effects(setting("inertia", jx=0.2, jz=-0.1)).vehicle
    assert_allclose(
        np.diag(vehicle.inertia), np.diag(VEHICLE.inertia) * [1.2, 1.0, 0.9], rtol=1e-15
    )
    assert vehicle.mass == VEHICLE.mass
    skew = replace(VEHICLE, inertia=np.array([[2e-3, 9e-4, 0], [9e-4, 2e-3, 0], [0, 0, 4e-3]]))
    with refused("inertia"):
        compile_effects(skew.with_effects(EffectSetting("inertia", {"jx": -0.85})))
    moved = declared({"mass": {"dm": 0.05}, "com_offset": {"cx": 0.01}})
    vehicle = compile_effects(moved).vehicle
    assert vehicle.mass == pytest.approx(VEHICLE.mass + 0.05)
    assert_array_equal(vehicle.com, [0.01, 0, 0])
    assert_array_equal(vehicle.inertia, VEHICLE.inertia)
