"""The scenarios of the fan-tracking tasks, and those of a user's own, as YAML files."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

import numpy as np
from pydantic import AfterValidator, Field

from ..controllers.briefing import PLACES
from ..dynamics.vehicle import NotNegative, Vehicle
from ..runtime.arrays import Array
from ..runtime.errors import InputError, unknown_name
from ..runtime.forms import STRICT, Positive, checked, expected
from ..runtime.python_file import is_file_name, named_in_file
from ..runtime.yaml_file import read_yaml

AnyScenario = TypeVar("AnyScenario")
_YAML = (".yaml", ".yml")


def _ordered(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] <= value[1]:
        raise ValueError("falls")
    return value


# types of the fields of a scenario's file
Range = Annotated[
    tuple[NotNegative, NotNegative],
    AfterValidator(_ordered),
    expected("two numbers that are not negative, the lower one first"),
]
Factors = Annotated[
    tuple[Positive, Positive],
    AfterValidator(_ordered),
    expected("two positive numbers, the lower one first"),
]
Motions = Annotated[
    tuple[Literal["sine", "triangle", "ramp", "still"], ...],
    Field(min_length=1),
    expected("a list of one or more of sine, triangle, ramp and still"),
]


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Ranges (low, high) of an episode's draws. Stated ranges replace fields of ``PlantSettings``
    in their units; None: no draw.
    """

    __pydantic_config__ = STRICT

    actuator_delay: Range | None = None
    pose_delay: Range | None = None
    imu_delay: Range | None = None
    dropout: Range | None = None
    dropout_burst: Range | None = None

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """Return one value of each field by its name, uniform, in the order of the fields."""
        return {name: rng.uniform(*r) for name, r in vars(self).items() if r is not None}


@dataclass(frozen=True)
class Variation(Drawn):
    """Domain randomisation: each value is uniform between two bounds, drawn anew each episode.

    A user's own distribution is a
    ``Scenario(..., varied=True, variation=Variation(mass=(0.8, 1.2)))``.
    """

    distance: Factors = (2.0, 2.7)  # m, from the fan
    # factors on what fan, plant and vehicle state
    fan_speed: Factors = (0.85, 1.25)
    rotor_drag: Range = (0.8, 1.2)
    hull_area: Range = (0.8, 1.2)
    mass: Factors = (0.93, 1.07)  # the true vehicle's; the filter keeps the declared
    inertia: Factors = (0.9, 1.1)


@dataclass(frozen=True)
class ScenarioBase:
    """Fields of every scenario: the measurement of the pose, and whether the vehicle varies."""

    __pydantic_config__ = STRICT

    summary: str = ""
    rise_time: Positive = 0.45  # s, of the filter
    sigma_position: Positive = 0.001  # m
    sigma_attitude: Positive = 0.005  # rad
    varied: bool = False  # the world is drawn anew each episode, by ``variation``


@dataclass(frozen=True)
class Scenario(ScenarioBase):
    """Motion of the fan, and start of the vehicle."""

    motions: Motions = ("sine", "triangle", "ramp", "still")
    speed: Range = (0.05, 0.35)  # m/s, largest speed of the fan
    offset: Range = (0.0, 0.1)  # m, from the fan's axis at the start, either side
    turbulence: NotNegative = 0.10
    variation: Variation = Variation()


def kept_scenarios(section: str, form: type[AnyScenario]) -> dict[str, AnyScenario]:
    """Return the kit's own scenarios of a section of ``scenarios.yaml``, by name."""
    stated = read_yaml(Path(__file__).with_name("scenarios.yaml"), "scenarios")[section].items()
    return {name: checked(form, fields, f"scenarios.yaml: {name}") for name, fields in stated}


SCENARIOS = kept_scenarios("fan", Scenario)


def draw_vehicle(vehicle: Vehicle, rng: np.random.Generator) -> Vehicle:
    """Return a vehicle as the true one may be where ``vehicle`` is declared: each number times
    ``exp(share z)``, with the shares of its ``uncertainty`` and standard normal ``z``.
    """
    known = vehicle.uncertainty

    def factor(share: float, size: int | None = None) -> Any:
        return np.exp(share * rng.standard_normal(size))

    command = factor(known.command * (vehicle.omega_source == "commanded"))
    arm = factor(known.arm_l)
    return replace(
        vehicle,
        mass=vehicle.mass * factor(known.mass),
        k=vehicle.k * command * factor(known.thrust) * factor(known.rotor, 4),
        p=vehicle.p * command * factor(known.torque),
        inertia=vehicle.inertia * factor(known.inertia),
        arm_l=vehicle.arm_l * arm,
        rotor_positions=vehicle.positions * arm,
    )


def scenarios_in(path: str, known: Mapping[str, AnyScenario]) -> dict[str, AnyScenario]:
    """Return the scenarios of a YAML file by name: ``FILE.yaml`` where the file states the fields
    of one, ``FILE.yaml:NAME`` where it has the groups of ``scenarios.yaml``.

    Raises:
        InputError: no such file; no group of this kind; or a field is unknown, malformed or out of
            range.
    """
    form = type(next(iter(known.values())))
    data, group = read_yaml(Path(path), "a scenario file"), "fan" if form is Scenario else "wind"
    if not isinstance(data, Mapping) or not data or not set(data) <= {"fan", "wind"}:
        return {path: checked(form, data, path)}
    some = data.get(group)
    if not isinstance(some, Mapping) or not some:
        raise InputError(f"{path}: {group}: expected scenarios by name, as in scenarios.yaml")
    return {f"{path}:{n}": checked(form, fields, f"{path}: {n}") for n, fields in some.items()}


def find_scenario(name: str, known: Mapping[str, AnyScenario]) -> AnyScenario:
    """Return a scenario by its name, of a YAML file, or of a Python file: ``FILE.py:NAME``. A file
    states any fields of the known scenarios; others keep their defaults.

    Raises:
        InputError: an unknown name, or as ``scenarios_in`` and ``named_in_file``.
    """
    if is_file_name(name):
        form = type(next(iter(known.values())))
        what = f"a Python file with a {form.__name__}"
        scenario = named_in_file(name, "scenario", what, lambda value: isinstance(value, form))
        return cast(AnyScenario, scenario)
    path = name if name.endswith(_YAML) else name.rpartition(":")[0]
    if path.endswith(_YAML):
        listed = scenarios_in(path, known)
        if name == path and len(listed) == 1:
            return next(iter(listed.values()))
        known = listed
    if name not in known:
        raise unknown_name("scenario", name, known)
    return known[name]


def draw_fan_path(scenario: Scenario, rng: np.random.Generator, t: Array) -> tuple[str, Array]:
    """Draw the fan's motion: its name, and y (n,) m at times ``t`` (n,) s.

    The path starts at 0. Sine and triangle swing 0.5-1.2 m to either side; a ramp stops after
    0.8-1.6 m.
    """
    motion = scenario.motions[rng.integers(len(scenario.motions))]
    speed, sign = rng.uniform(*scenario.speed), rng.choice([-1.0, 1.0])
    travel = rng.uniform(0.5, 1.2)
    return motion, sign * PLACES[motion](speed, travel, t)
