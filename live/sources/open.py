"""From an address to a source."""

import importlib

from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...runtime.errors import InputError, unknown_name
from ..tallies import Tallies
from .base import Source

# by kind: the module, loaded on demand, its class, and the form of the address
SOURCES = {
    "sim": ("simulated", "Simulated", "sim:SCENARIO"),
    "-": ("json_messages", "JsonLines", "- (lines of JSON on standard input)"),
    "udp-json": ("json_messages", "UdpJson", "udp-json://HOST:PORT"),
    "mavlink": ("mavlink", "Mavlink", "mavlink:udp://HOST:PORT or mavlink:/dev/ttyUSB0"),
}
MAPPED = ("-", "udp-json")  # kinds with a map of fields


def kind_of(text: str) -> str:
    """Return the kind of source in an address.

    Raises:
        InputError: there is no such kind.
    """
    kind = text.partition(":")[0]
    if kind not in SOURCES or (kind == "-") == (":" in text):
        raise unknown_name(
            "source", text, [form for *_, form in SOURCES.values()], "windwrench live"
        )
    return kind


def make_source(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    """Return the source of an address, not yet open.

    Raises:
        InputError: there is no such source, an option is wrong, or the source takes no map.
    """
    kind = kind_of(text)
    if log_map is not None and kind not in MAPPED:
        raise InputError(
            f"--map: {text} states what its messages mean; expected a map with - or "
            "udp-json:// alone"
        )
    module, name, _ = SOURCES[kind]
    made: type[Source] = getattr(importlib.import_module(f".{module}", __package__), name)
    return made(text, vehicle, tallies, log_map)
