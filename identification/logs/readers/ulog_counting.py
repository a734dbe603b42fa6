"""pyulog's parser with a count of what it makes of a file: some bytes of a ULog may stand for many
objects.

Topics are written out field by field for every subscription, with arrays and topics within topics;
every parameter, piece of information, text and dropout becomes an object of its own. Both are
counted before they are made.
"""

from collections import Counter
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
    counts: Counter[str] = Counter()

    def count(what: str, most: int, more: int = 1) -> None:
        counts[what] += more
        if counts[what] > most:
            raise TooMuchError(f"more than {most} {what}")

    class AddLogged(parser._MessageAddLogged):  # type: ignore[misc]
        def _parse_format(self, message_formats: Mapping[str, Any]) -> None:
            # one that has none takes its place, too
            more = 1 + _fields(self.message_name, message_formats, {}, 0)
            count("fields of its topics", LIMITS.ulog_fields, more)
            super()._parse_format(message_formats)

    def counted(kind: Any) -> Any:
        class Counted(kind):  # type: ignore[misc]
            def __init__(self, *arguments: Any, **options: Any) -> None:
                what = "parameters, pieces of information, texts and dropouts"
                count(what, LIMITS.ulog_texts)
                super().__init__(*arguments, **options)

        return Counted

    class Counting(parser):  # type: ignore[misc]
        _MessageAddLogged = AddLogged
        _MessageInfo = counted(parser._MessageInfo)
        MessageLogging = counted(parser.MessageLogging)
        MessageLoggingTagged = counted(parser.MessageLoggingTagged)
        MessageDropout = counted(parser.MessageDropout)

        def _check_packet_corruption(self, header: Any) -> bool:
            is_damaged = bool(super()._check_packet_corruption(header))
            count("places hold no message", LIMITS.ulog_damages, is_damaged)
            return is_damaged

    return Counting


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
