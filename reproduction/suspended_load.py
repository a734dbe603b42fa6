"""A body that hangs from the vehicle by a thread: it swings, has inertia, and pulls only when the
thread is taut.

The thread is a MuJoCo spatial tendon with an upper limit on its length, between a point of the
vehicle and a small free body. Until it is hung on, the load stands on its own (gravity is taken off
it) and the thread's limit is off.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import mujoco
import numpy as np

from ..dynamics.motion import Array
from ..envs.closed_loop import ClosedLoop
from ..envs.plant import load_world
from ..runtime.errors import InputError

_NAME = "load"
_RADIUS = 0.0115  # m, a 53 g ball of steel; for inertia and drawing
# Of the thread's limit: time constant (s) and damping ratio. Four steps of MuJoCo are the stiffest
# that stays smooth: the thread of a 53 g load gives by 0.1 mm.
_THREAD = (0.01, 1.0)


@dataclass(frozen=True)
class SuspendedLoad:
    """A load and the thread that it hangs from.

    Raises:
        InputError: a number out of range.
    """

    mass: float = 0.053  # kg
    # m, from the geometric centre, body axes
    anchor: tuple[float, float, float] = (0.0, 0.0, -0.02)
    length: float = 0.15  # m, of the thread to the load's centre
    # N/(m/s), air and thread: lets a swing decay in about 2 * mass / drag = 10 s
    drag: float = 0.01

    def __post_init__(self) -> None:
        for name, low in (("mass", 1e-4), ("length", 1e-3), ("drag", 0.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= low):
                raise InputError(
                    f"SuspendedLoad: {name} must be finite and at least {low:g}, got {value!r}"
                )
        if len(self.anchor) != 3 or not all(math.isfinite(v) for v in self.anchor):
            raise InputError(
                f"SuspendedLoad: anchor must be three numbers in m, got {self.anchor!r}"
            )


def add_load(spec: "mujoco.MjSpec", load: SuspendedLoad) -> None:
    """Add the load and its slack thread to a world that is not compiled yet; the vehicle must be in
    it already.
    """
    anchor = spec.body("vehicle").add_site(name="anchor", pos=load.anchor, size=[0.004] * 3)
    body = spec.worldbody.add_body(name=_NAME, gravcomp=1.0)
    body.add_freejoint(name=_NAME)
    inertia = 0.4 * load.mass * _RADIUS * _RADIUS
    body.mass, body.inertia, body.explicitinertial = load.mass, [inertia] * 3, True
    body.add_geom(
        name=_NAME,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[_RADIUS] * 3,
        rgba=[0.3, 0.3, 0.35, 1.0],
        mass=0.0,
    )
    centre = body.add_site(name=_NAME, size=[0.002] * 3)
    thread = spec.add_tendon(
        name="thread",
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=[0.0, load.length],
        solref_limit=_THREAD,
        width=0.0015,
        rgba=[0.2, 0.2, 0.2, 1.0],
    )
    thread.wrap_site(anchor.name)
    thread.wrap_site(centre.name)


def set_down(model: "mujoco.MjModel", data: "mujoco.MjData", load: SuspendedLoad) -> None:
    """Take the load off the vehicle: it stands on its own, at rest, below its anchor, and the
    thread does not pull.
    """
    model.body_gravcomp[model.body(_NAME).id] = 1.0
    model.tendon_limited[model.tendon("thread").id] = 0
    model.joint(_NAME).damping[:3] = load.drag
    _place(model, data, load)
    data.joint(_NAME).qvel[:] = 0.0


def hang(model: "mujoco.MjModel", data: "mujoco.MjData", load: SuspendedLoad) -> None:
    """Hang the load on: straight below its anchor on the taut thread, moving with the anchor, and
    let go.
    """
    velocity = np.zeros(6)
    site = model.site("anchor").id
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, site, velocity, 0)
    _place(model, data, load)
    data.joint(_NAME).qvel[:3], data.joint(_NAME).qvel[3:] = velocity[3:], 0.0
    model.body_gravcomp[model.body(_NAME).id] = 0.0
    model.tendon_limited[model.tendon("thread").id] = 1


def _place(model: "mujoco.MjModel", data: "mujoco.MjData", load: SuspendedLoad) -> None:
    mujoco.mj_kinematics(model, data)
    pose = data.joint(_NAME).qpos
    pose[:3] = data.site("anchor").xpos - [0.0, 0.0, load.length]
    pose[3:] = [1.0, 0.0, 0.0, 0.0]


def pull(data: "mujoco.MjData", com: Array) -> Array:
    """Return force (N) and torque about the centre of mass ``com`` (3,) m, (6,) world, of the
    thread on the vehicle now.
    """
    force = data.qfrc_constraint[:3].copy()  # the thread is the world's one constraint
    rotation = data.body("vehicle").xmat.reshape(3, 3)
    torque = rotation @ data.qfrc_constraint[3:6] - np.cross(rotation @ com, force)
    return np.concatenate([force, torque])


class LoadedLoop(ClosedLoop):
    """A closed loop with a load, which ``hang_load`` hangs on; None: no load.

    Args:
        *shared: as of ``ClosedLoop``.
        load: the body and its thread.
        **named: as of ``ClosedLoop``.
    """

    def __init__(self, *shared: Any, load: SuspendedLoad | None, **named: Any) -> None:
        self.load = load
        super().__init__(*shared, **named)

    def _make_world(
        self, drawn: bool, like: ClosedLoop | None
    ) -> tuple[mujoco.MjModel, mujoco.MjData]:
        add = None if self.load is None else partial(add_load, load=self.load)
        return load_world(self._body, drawn, add)

    def reset(self, *shared: Any, **named: Any) -> None:
        """Hover as ``ClosedLoop`` does, with the load set down."""
        super().reset(*shared, **named)
        if self.load is not None:
            set_down(self.model, self.data, self.load)
            mujoco.mj_forward(self.model, self.data)

    def hang_load(self) -> None:
        """Hang the load on: at rest below its anchor on the taut thread.

        Raises:
            InputError: this loop was made without a load.
        """
        if self.load is None:
            raise InputError(
                "ClosedLoop: there is no load to hang on; give one with load=SuspendedLoad(...)"
            )
        hang(self.model, self.data, self.load)

    def load_pull(self) -> Array:
        """Return the true force (N) and torque (Nm) about the centre of mass, (6,) world, of a load
        on the vehicle.
        """
        return pull(self.data, self._body.com)
