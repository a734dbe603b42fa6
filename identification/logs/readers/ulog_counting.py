"""pyulog's parser with a count of what it makes of a file: some bytes of a ULog may stand for many
objects.

Topics are written out field by field for every subscription, with arrays and topics within topics;
every parameter and every piece of information becomes an entry of its own. Both are counted before
they are made. Texts and dropouts, which the reader does not use, are parsed and forgotten.
"""

from collections.abc import Mapping
from typing import Any

from ....runtime.file_limits import LIMITS

_DEEPEST = 20  # topics within topics


class TooMuchError(Exception):
    """Ends the parser: it takes all usual errors for damage and goes on."""


def counting(parser: Any) -> Any:
    """Return pyulog's class ``ULog`` as one that raises TooMuchError where a file has more than
    ``FileLimits`` allows.
    """
    fields = texts = damages = 0

    class AddLogged(parser._MessageAddLogged):  # type: ignore[misc]
        def _parse_format(self, message_formats: Mapping[str, Any]) -> None:
            nonlocal fields
            # one that has none takes its place, too
            fields += 1 + _fields(self.message_name, message_formats, {}, 0)
            if fields > LIMITS.ulog_fields:
                raise TooMuchError(
                    f"its topics have more than {LIMITS.ulog_fields} fields, those of "
                    f"{self.message_name[:100]!r} among them"
                )
            super()._parse_format(message_formats)

    class Info(parser._MessageInfo):  # type: ignore[misc]
        def __init__(self, *arguments: Any, **options: Any) -> None:
            nonlocal texts
            texts += 1
            if texts > LIMITS.ulog_texts:
                raise TooMuchError(
                    f"more than {LIMITS.ulog_texts} parameters and pieces of information"
                )
            super().__init__(*arguments, **options)

    class Counting(parser):  # type: ignore[misc]
        _MessageAddLogged = AddLogged
        _MessageInfo = Info
        MessageLogging = _forgotten(parser.MessageLogging)
        MessageLoggingTagged = _forgotten(parser.MessageLoggingTagged)
        MessageDropout = _forgotten(parser.MessageDropout)

        def _check_packet_corruption(self, header: Any) -> bool:
            nonlocal damages
            is_damaged = bool(super()._check_packet_corruption(header))
            damages += is_damaged
            if damages > LIMITS.ulog_damages:
                raise TooMuchError(f"more than {LIMITS.ulog_damages} places hold no message")
            return is_damaged

    return Counting


def _forgotten(kind: Any) -> Any:
    """Return a class that parses like ``kind`` but has one instance, the last."""

    class Last(kind):  # type: ignore[misc]
        instance: Any = None

        def __new__(cls, *_: object) -> Any:
            if cls.instance is None:
                cls.instance = super().__new__(cls)
            return cls.instance

    return Last


def _fields(name: str, formats: Mapping[str, Any], known: dict[str, int], depth: int) -> int:
    """Return how many fields a topic has once its arrays and the topics in it are written out."""
    if depth > _DEEPEST:
        raise TooMuchError(f"topic {name[:100]!r} lies more than {_DEEPEST} deep in others")
    if name not in known:
        known[name] = sum(
            max(1, size) * (_fields(kind, formats, known, depth + 1) if kind in formats else 1)
            for kind, size, _ in formats[name].fields
        )
    return known[name]
