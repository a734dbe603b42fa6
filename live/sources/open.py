"""From what a user names to a source."""

from collections.abc import Callable

from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...runtime.errors import InputError, unknown_name
from ..tallies import Tallies
from .base import Source

Maker = Callable[[str, Vehicle, LogMap | None, Tallies], Source]


def _text(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    from .text_stream import TextStream

    if text not in ("-", "csv:-"):
        raise InputError(
            f"{text}: expected csv:- or -, a table on standard input; windwrench estimate reads "
            "files"
        )
    return TextStream(vehicle, log_map, tallies)


def _udp_json(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    from .udp_json import UdpJson

    return UdpJson(text, vehicle, log_map, tallies)


def _simulated(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    from .simulated import Simulated

    return Simulated(text, vehicle)


def _mavlink(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    from .mavlink import Mavlink

    return Mavlink(text, vehicle, tallies)


def _crazyflie(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    from .crazyflie import CrazyflieLog

    return CrazyflieLog(text, vehicle, tallies)


def _ros2(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    from .ros2 import Ros2

    return Ros2(text, vehicle, tallies)


SOURCES: dict[str, tuple[Maker, str]] = {
    "sim": (_simulated, "sim:SCENARIO"),
    "csv": (_text, "- or csv:- (a table on standard input)"),
    "udp-json": (_udp_json, "udp-json://HOST:PORT"),
    "mavlink": (_mavlink, "mavlink:udp://HOST:PORT or mavlink:/dev/ttyUSB0"),
    "crazyflie": (_crazyflie, "crazyflie:radio://0/80/2M/E7E7E7E7E7"),
    "ros2": (_ros2, "ros2:TOPICS.yaml"),
}
MAPPED = ("csv", "udp-json")  # kinds whose fields a map can name


def kind_of(text: str) -> str:
    """Return which kind of source a user names.

    Raises:
        InputError: there is no such kind.
    """
    kind = "csv" if text == "-" else text.partition(":")[0]
    if kind not in SOURCES or (text != "-" and ":" not in text):
        raise unknown_name(
            "source", text, [form for _, form in SOURCES.values()], "windwrench live"
        )
    return kind


def make_source(text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies) -> Source:
    """Return the source that a user names; it is not opened yet.

    Raises:
        InputError: there is no such source, an option of it is wrong, or it takes no map.
    """
    kind = kind_of(text)
    if log_map is not None and kind not in MAPPED:
        raise InputError(
            f"--map: {text} states what its messages mean; expected a map with csv:- or "
            "udp-json:// alone"
        )
    return SOURCES[kind][0](text, vehicle, log_map, tallies)
