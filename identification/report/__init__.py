"""A diagnosis for people and machines: page, pictures, sentences, `report.json`."""

from .files import report_data, report_schema, write_report

__all__ = ["report_data", "report_schema", "write_report"]


def __dir__() -> list[str]:
    return __all__
