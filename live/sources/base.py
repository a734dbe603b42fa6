"""What a source of messages is, and how its address is read."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Protocol
from urllib.parse import parse_qsl, urlsplit

from ...runtime.errors import InputError
from ..filtering import Output
from ..messages import Sample
from ..tallies import Tallies


class Source(Protocol):
    """A stream of messages."""

    name: str  # for people
    paced: bool  # messages arrive at the vehicle's own pace

    def open(self) -> None:
        """Begin to listen.

        Raises:
            InputError: there is no such source, or it cannot be opened.
        """
        ...

    def receive(self, timeout: float) -> list[Sample] | None:
        """Return what has come, after at most ``timeout`` s; None: the stream has ended.

        Raises:
            InputError: what comes is none of this source's messages.
        """
        ...

    def send(self, output: Output) -> None:
        """Tell the sender the estimate, where it wants to know."""
        ...

    def close(self) -> None:
        """Listen no more."""
        ...

    def expected(self) -> str:
        """Return what must come and has not, for an error."""
        ...


class Malformed:
    """Counts messages that say nothing. The first of a stream ends it: it is of another kind than
    the user thinks. Later ones are counted.
    """

    def __init__(self, where: str, tallies: Tallies) -> None:
        self._where, self._tallies = where, tallies
        self.good = False  # one has been understood
        self.first = ""  # what was wrong with the first that was counted

    def take(self, why: str) -> None:
        """Count one.

        Raises:
            InputError: none was good before.
        """
        if not self.good:
            raise InputError(f"{self._where}: {why}")
        self._tallies.counts["malformed"] += 1
        self.first = self.first or why


@dataclass(frozen=True)
class Address:
    """``KIND:REST?option=value``, or ``KIND://HOST:PORT?option=value``."""

    text: str
    kind: str
    scheme: str  # within: udp, tcp, radio; or nothing
    host: str
    port: int | None
    path: str
    options: dict[str, str] = field(default_factory=dict)

    def number(self, name: str, default: float, least: float = 0.0) -> float:
        """Return an option that is a number.

        Raises:
            InputError: it is none, or below the least.
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

    def choice(self, name: str, known: tuple[str, ...], default: str) -> str:
        """Return an option that is one of several words.

        Raises:
            InputError: it is none of them.
        """
        value = self.options.get(name, default)
        if value not in known:
            raise InputError(f"{self.text}: {name}={value}: expected one of {', '.join(known)}")
        return value


def read_address(text: str, kind: str, options: tuple[str, ...]) -> Address:
    """Return the parts of a source's address.

    Raises:
        InputError: it is none, or has an option that is not known.
    """
    rest = text.removeprefix(kind).removeprefix(":")
    try:
        split = urlsplit(rest)
        port = split.port
        given = parse_qsl(split.query, keep_blank_values=True, strict_parsing=bool(split.query))
    except ValueError as error:
        raise InputError(f"{text}: no address: {error}") from error
    for name, _ in given:
        if name not in options:
            expected = ", ".join(options) if options else "none"
            raise InputError(f"{text}: unknown option {name!r}; expected {expected}")
    repeated = [name for name, count in Counter(name for name, _ in given).items() if count > 1]
    if repeated:
        raise InputError(f"{text}: option {repeated[0]} stands there more than once")
    return Address(text, kind, split.scheme, split.hostname or "", port, split.path, dict(given))
