"""The wrench filter of a vehicle, and a policy, as C for a flight controller."""

from .c_numbers import PRECISIONS
from .export import ESTIMATORS, Exported, export_c
from .policies import exportable_policy

__all__ = ["ESTIMATORS", "PRECISIONS", "Exported", "export_c", "exportable_policy"]
