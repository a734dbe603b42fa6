"""The wrench filter of a vehicle, and a policy, for a flight controller."""

from .export import ESTIMATORS, Exported, export_c
from .flights import CONTROLLERS
from .numbers import PRECISIONS
from .policies import exportable_policy

__all__ = ["CONTROLLERS", "ESTIMATORS", "PRECISIONS", "Exported", "export_c", "exportable_policy"]
