"""Measured data: flight logs, the wrench on a logged flight, and what its vehicle's model lacks."""

from typing import Any

__all__ = ["FlightLog", "diagnose", "estimate_log", "predict", "read_log", "report_data"]


def __getattr__(name: str) -> Any:
    # what a name needs is imported when it is asked for: reading a log needs no inference, and no
    # page
    if name in ("FlightLog", "read_log"):
        from .logs import flight_log, reading

        return flight_log.FlightLog if name == "FlightLog" else reading.read_log
    if name == "estimate_log":
        from .wrench_series import estimate_log

        return estimate_log
    if name == "predict":
        from .prediction import predict

        return predict
    if name == "diagnose":
        from .diagnosis import diagnose

        return diagnose
    if name == "report_data":
        from .report.files import report_data

        return report_data
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
