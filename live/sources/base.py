"""The base of all sources of messages, and their addresses."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar
from urllib.parse import parse_qsl, urlsplit

from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...runtime.errors import InputError
from ..filtering import Output
from ..messages import Malformed, Measurement
from ..tallies import Tallies

# s of waiting for a reader of the estimates or a stalled disk, for a file: nothing flies
WAITS = 60.0
Result = TypeVar("Result")
_RESTARTED = 1_000  # messages; a larger fall of a count is a new count
_NONE_GOOD = 100  # malformed messages without a good one: a stream of another kind
_TOLD = 3  # malformed messages in words; all are counted
_MOST_LOST = 1_000_000  # messages; a larger rise of a count is another count


class Source(ABC):
    """A stream of messages, listened to at an address.

    Args:
        text: the address.
        vehicle: the vehicle in flight.
        tallies: counts lost and malformed messages.
        log_map: meaning of the messages' fields, for a source with a map; None: this kit's.

    Raises:
        InputError: the address is wrong, or a library is not installed.
    """

    kind = ""  # begins an address
    options: tuple[str, ...] = ()  # in an address
    paced = True  # messages arrive at the vehicle's own pace
    patience = 0.0  # s of waiting for readers of the estimates, if not paced
    strict = False  # malformed messages alone are an error
    answers = False  # estimates are sent back
    link: Any = None  # the ``Link`` of a source, if any
    expected = ""  # the messages needed, for the error of an empty stream

    def __init__(
        self, text: str, vehicle: Vehicle, tallies: Tallies, log_map: LogMap | None = None
    ) -> None:
        self.name = text  # for people
        self.address = _read_address(text, self.kind, self.options)
        self.vehicle = vehicle
        self.tallies = tallies
        self.log_map = log_map
        self.problems: list[str] = []  # the first malformed messages'
        self._understood = not self.strict
        self._numbers: dict[object, int] = {}  # the newest of each sender's own count
        self._prepare()

    @abstractmethod
    def _prepare(self) -> None:
        """Read the options of the address.

        Raises:
            InputError: an option is wrong.
        """

    def open(self) -> None:
        """Begin to listen, at the source's link if any.

        Raises:
            InputError: there is no such source, or opening fails.
        """
        if self.link is not None:
            self.tallies.say(self.link.open())

    @abstractmethod
    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the raw messages so far, after at most ``timeout`` s, with their arrivals, ns;
        None: the stream has ended.

        Raises:
            InputError: the stream is of another kind.
        """

    def decode(self, message: Any, arrival: int) -> Measurement | None:
        """Return the measurement in a message, or None.

        Raises:
            Malformed: there is none to read.
        """
        sample: Measurement = message
        return sample

    def receive(self, timeout: float) -> list[Measurement] | None:
        """Return the measurements so far; None: the stream has ended.

        Raises:
            InputError: as ``read``; or the first 100 messages of a strict source are malformed.
        """
        messages = self.read(timeout)
        if messages is None:
            return None
        decoded = (self.unless_malformed(self.decode, *message) for message in messages)
        samples = [sample for sample in decoded if sample is not None]
        self._understood |= bool(samples)
        return samples

    def unless_malformed(self, decode: Callable[..., Result], *message: Any) -> Result | None:
        """Return a function's result for a message; None: malformed, and counted."""
        try:
            with self.tallies.spared("not decoded", f"a message of {self.name}"):
                return decode(*message)
        except Malformed as why:
            self.tallies.counts["malformed"] += 1
            if len(self.problems) < _TOLD and str(why) not in self.problems:
                self.problems.append(str(why))
                self.tallies.say(f"warning: {self.name}: left out as malformed: {why}")
            if not self._understood and self.tallies.counts["malformed"] >= _NONE_GOOD:
                raise InputError(
                    f"{self.name}: all of the first {_NONE_GOOD} messages are malformed, the "
                    f"first: {self.problems[0]}"
                ) from why
        return None

    def send(self, output: Output) -> None:  # noqa: B027 - most senders want nothing
        """Send the estimate to the sender, if wanted.

        Raises:
            OSError: the link takes no more now.
        """

    def close(self) -> None:
        """Listen no more."""
        if self.link is not None:
            self.link.close()

    def count_lost(self, sender: object, number: int, wraps: int = 0) -> None:
        """Count the messages missing before one in its sender's own count.

        Args:
            sender: the sender of the count.
            number: the message's.
            wraps: the count begins at 0 again after so many; 0: never.
        """
        last = self._numbers.get(sender, number - 1)
        number = unwrapped(number, last, wraps) if wraps else number
        missing = number - last - 1
        if -_RESTARTED < missing < 0:  # late, or once more
            if missing < -1 and self.tallies.counts["lost"] > 0:
                self.tallies.counts["lost"] -= 1
            return
        if 0 < missing < _MOST_LOST:
            self.tallies.counts["lost"] += missing
        self._numbers[sender] = number


def unwrapped(count: int, last: int, wraps: int) -> int:
    """Return the number of a count modulo ``wraps`` that lies nearest to the last number."""
    return last + (count - last + wraps // 2) % wraps - wraps // 2


@dataclass(frozen=True)
class Address:
    """``KIND:REST?option=value``, or ``KIND://HOST:PORT?option=value``."""

    text: str
    scheme: str  # within: udp, tcp, radio; or nothing
    host: str
    port: int | None
    path: str
    options: dict[str, str] = field(default_factory=dict)

    def number(self, name: str, default: float, least: float = 0.0) -> float:
        """Return a number from the options.

        Raises:
            InputError: the option is no number, or below the least.
        """
        text = self.options.get(name)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if not least <= value < 1e12:
            raise InputError(f"{self.text}: {name}={text}: expected a number of at least {least:g}")
        return value

    def choice(self, name: str, known: tuple[str, ...]) -> str:
        """Return one of several words from the options; default: the first word.

        Raises:
            InputError: the option is another word.
        """
        value = self.options.get(name, known[0])
        if value not in known:
            raise InputError(f"{self.text}: {name}={value}: expected one of {', '.join(known)}")
        return value


def _read_address(text: str, kind: str, options: tuple[str, ...]) -> Address:
    """Return the parts of a source's address.

    Raises:
        InputError: the address is wrong, or an option is unknown.
    """
    rest = text.removeprefix(kind).removeprefix(":")
    try:
        split = urlsplit(rest)
        port = split.port
        pairs = parse_qsl(split.query, keep_blank_values=True, strict_parsing=bool(split.query))
    except ValueError as error:
        raise InputError(f"{text}: no address: {error}") from error
    names = [name for name, _ in pairs]
    for name in names:
        if name not in options:
            expected = ", ".join(options) if options else "none"
            raise InputError(f"{text}: unknown option {name!r}; expected {expected}")
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise InputError(f"{text}: option {repeated[0]} stands there more than once")
    return Address(text, split.scheme, split.hostname or "", port, split.path, dict(pairs))
