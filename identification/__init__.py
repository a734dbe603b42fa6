"""Measured data: flight logs, the wrench on a logged flight, and effects missing in its model."""

from importlib import import_module
from typing import Any

# a name's module is imported when the name is asked for: reading a log needs no inference, no page
_MODULES = {
    "FlightLog": "logs.flight_log",
    "diagnose": "diagnosis",
    "estimate_log": "wrench_series",
    "predict": "prediction",
    "read_log": "logs.reading",
    "report_data": "report.files",
}
__all__ = ["FlightLog", "diagnose", "estimate_log", "predict", "read_log", "report_data"]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
