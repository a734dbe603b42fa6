"""Modules that have moved: their old import paths keep working, with a ``DeprecationWarning`` that
names the new ones.
"""

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

_PACKAGE = __package__.partition(".")[0]

# old names to new ones, both below the package; what was one module and is several now has several
MOVED: dict[str, tuple[str, ...]] = {
    "benchmarks": ("speed",),
    "benchmarks.environment_profile": ("speed.environment_profile",),
    "benchmarks.filter_step": ("speed.filter_step",),
    "benchmarks.flight_speed": ("speed.flight_speed",),
    "benchmarks.growth": ("speed.growth",),
    "benchmarks.speed": ("speed.contenders",),
    "controllers.bounds": ("controllers.references",),
    "dynamics.compiled": ("runtime.compiled",),
    "dynamics.effect_page": ("commands.effect_page",),
    "dynamics.errors": ("runtime.errors",),
    "dynamics.files": ("runtime.whole_files",),
    "dynamics.jet": ("dynamics.mean_jet",),
    "dynamics.lanes": ("runtime.vector_lanes",),
    "dynamics.python_file": ("runtime.python_file",),
    "dynamics.workers": ("runtime.workers",),
    "dynamics.yaml_file": ("runtime.yaml_file",),
    "envs.jet": ("envs.fan",),
    "envs.marks": ("envs.scene_shapes",),
    "envs.outcome": ("envs.decision",),
    "envs.stepping": ("envs.mujoco_step", "runtime.random_normals"),
    "envs.turns": ("runtime.work_sharing",),
    "estimator.by_address": ("runtime.addresses",),
    "estimator.direct": ("runtime.compiled",),
    "estimator.side_by_side": ("runtime.compiled",),
    "experiments": ("paper",),
    "experiments.calm_jet": ("paper.calm_jet",),
    "experiments.extension": ("paper.extension",),
    "experiments.fig3": ("paper.fig3",),
    "experiments.fig4": ("paper.fig4",),
    "experiments.fig4_picture": ("paper.fig4_picture",),
    "experiments.fig5": ("paper.fig5",),
    "experiments.fig5_estimators": ("paper.fig5_estimators",),
    "experiments.fig5_flights": ("paper.fig5_flights",),
    "experiments.fig5_peer": ("paper.fig5_peer",),
    "experiments.fig5_picture": ("paper.fig5_picture",),
    "experiments.fig6": ("paper.fig6",),
    "experiments.fig6_picture": ("paper.fig6_picture",),
    "experiments.fig7": ("paper.fig7",),
    "experiments.fig7_picture": ("paper.fig7_picture",),
    "experiments.hanging_mass": ("paper.hanging_mass",),
    "experiments.reproduce": ("paper.reproduce",),
    "experiments.result": ("paper.result",),
    "identification.bounds": ("identification.inference.coefficient_range",),
    "identification.commanded": ("identification.inference.commanded_rotors",),
    "identification.conventions": ("identification.logs.conventions",),
    "identification.dictionary": ("identification.inference.candidate_regressors",),
    "identification.equivalence": ("identification.inference.equivalence",),
    "identification.estimate": (
        "identification.wrench_series",
        "identification.report.wrench_picture",
    ),
    "identification.excerpt": ("identification.logs.excerpt",),
    "identification.files": ("identification.logs.tables",),
    "identification.flight_log": ("identification.logs.flight_log", "identification.logs.reading"),
    "identification.floor": ("identification.motion.sensor_noise",),
    "identification.gusts": ("identification.inference.disturbance_filter",),
    "identification.innovations": ("identification.inference.innovations",),
    "identification.measuring": ("identification.inference.likelihood_refit",),
    "identification.moves": ("identification.inference.stepwise_search",),
    "identification.phases": ("identification.logs.flight_phases",),
    "identification.pushes": ("identification.inference.transient_disturbances",),
    "identification.readers": ("identification.logs.readers",),
    "identification.readers.crazyswarm2": ("identification.logs.readers.crazyswarm2",),
    "identification.readers.nanobench": ("identification.logs.readers.nanobench",),
    "identification.readers.px4_ulog": ("identification.logs.readers.px4_ulog",),
    "identification.readers.rosbag": ("identification.logs.readers.rosbag",),
    "identification.readers.streams": ("identification.logs.readers.streams",),
    "identification.readers.unpacking": ("identification.logs.readers.unpacking",),
    "identification.regression": ("identification.inference.regression",),
    "identification.report_page": ("identification.report.page",),
    "identification.report_pictures": ("identification.report.pictures",),
    "identification.report_words": ("identification.report.words",),
    "identification.residual": ("identification.motion.residual",),
    "identification.screening": ("identification.logs.screening",),
    "identification.search": ("identification.inference.search",),
    "identification.selection": ("identification.inference.gram_matrix",),
    "identification.sensing": ("identification.motion.sensing_effects",),
    "identification.signals": ("identification.motion.signals",),
    "identification.starts": ("identification.inference.starting_points",),
    "identification.structure": ("identification.inference.residual_structure",),
    "identification.turning": ("identification.inference.turning_delay",),
    "identification.whitening": ("identification.inference.whitening",),
    "identification.wrench_plot": ("identification.report.wrench_picture",),
    "training.benchmark": ("evaluation.benchmark", "envs.watched_fan_tracking"),
    "training.cluster": ("training.sweep", "training.rllib", "runtime.cluster"),
    "training.evaluate": ("evaluation.episodes",),
    "training.extras": ("runtime.extras",),
    "training.features": ("controllers.features",),
    "training.leaderboard_page": ("studies.learning.leaderboard_page",),
    "training.leaderboard_pictures": ("studies.learning.leaderboard_pictures",),
    "training.leaderboard_rows": ("evaluation.leaderboard",),
    "training.pictures": ("evaluation.pictures",),
    "training.policy": ("controllers.trained_policy",),
    "training.sensing": ("envs.watched_fan_tracking",),
    "training.statistics": ("evaluation.statistics",),
    "training.study": ("studies.learning.study",),
    "training.worlds": ("training.training_envs",),
}

# names that have another one in their new place
RENAMED: dict[str, str] = {
    "training.benchmark.world_for": "scenario_env",
}


class _Forwarder(ModuleType):
    """A module of an old name: it has what the modules have that took its place."""

    def __init__(self, name: str, places: tuple[ModuleType, ...]) -> None:
        super().__init__(name, f"Moved to {', '.join(place.__name__ for place in places)}.")
        self.__dict__["_places"] = places
        self.__path__: list[str] = []  # what lies below an old name has moved as well

    def __getattr__(self, name: str) -> object:
        new = RENAMED.get(f"{self.__name__.partition('.')[2]}.{name}", name)
        for place in self.__dict__["_places"]:
            if hasattr(place, new):
                return getattr(place, new)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return sorted({name for place in self.__dict__["_places"] for name in dir(place)})


class _MovedFinder(MetaPathFinder, Loader):
    """Asked last, when no file has a module's name."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how a module that has moved is imported; None for any other name."""
        package, _, name = fullname.partition(".")
        return (
            ModuleSpec(fullname, self, is_package=True)
            if package == _PACKAGE and name in MOVED
            else None
        )

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Import what took a module's place, and return a module of the old name that forwards to
        it.
        """
        places = [f"{_PACKAGE}.{new}" for new in MOVED[spec.name.partition(".")[2]]]
        # it points at the import statement: Python passes over its import system's own frames
        warnings.warn(
            f"{spec.name} is now {' and '.join(places)}", DeprecationWarning, stacklevel=2
        )
        return _Forwarder(spec.name, tuple(import_module(place) for place in places))

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: the modules that took its place ran when they were imported."""


def keep_old_paths() -> None:
    """Make the old import paths known to Python's import system, once."""
    if not any(isinstance(finder, _MovedFinder) for finder in sys.meta_path):
        sys.meta_path.append(_MovedFinder())
