"""What a prompt shows of a package: its public names, and in ``help`` an argument a line."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from typing import Any, TypeVar

T = TypeVar("T")
_WIDTH = 80
_NAMED = inspect.Parameter.KEYWORD_ONLY


class _Name(str):
    """The name of a type, shown without quotes."""

    __slots__ = ()
    __repr__ = str.__str__


class _Lines(inspect.Signature):
    """A signature that is shown as ``help`` of Python 3.13 shows it: wrapped where it is long."""

    def format(self, **given: Any) -> str:
        """Return it without quotes about types, and without the fields of default settings."""
        shown = [
            each.replace(annotation=_bare(each.annotation), default=_short(each.default))
            for each in self.parameters.values()
        ]
        line = str(inspect.Signature(shown, return_annotation=_bare(self.return_annotation)))
        if len(line) < _WIDTH:
            return line
        parts, kinds = [str(each) for each in shown], [each.kind for each in shown]
        if _NAMED in kinds and inspect.Parameter.VAR_POSITIONAL not in kinds:
            parts.insert(kinds.index(_NAMED), "*")
        _, arrow, returned = line.rpartition(" -> ")
        return "(\n    {},\n)".format(",\n    ".join(parts)) + arrow + returned * bool(arrow)

    __str__ = format


def public(names: Sequence[str], given: Mapping[str, Any]) -> Callable[[], list[str]]:
    """Return the ``__dir__`` of a package with public names; those among ``given`` have a ``help``
    that can be read.
    """
    for name in names:
        readable(given.get(name))
    return lambda: list(names)


def readable(shown: T) -> T:
    """Return a class or a function of this kit, with an argument a line in its ``help``."""
    own = __name__.partition(".")[0]
    kinds = [kind for kind in getattr(shown, "__mro__", ()) if kind.__module__.startswith(own)]
    for each in (shown, *(value for kind in kinds for value in vars(kind).values())):
        function = inspect.unwrap(getattr(each, "__func__", each))
        if inspect.isfunction(function) and "__signature__" not in vars(function):
            signature = inspect.signature(function)
            vars(function)["__signature__"] = _Lines(
                signature.parameters.values(), return_annotation=signature.return_annotation
            )
    return shown


def _bare(annotation: Any) -> Any:
    return _Name(annotation) if isinstance(annotation, str) else annotation


def _short(default: Any) -> Any:
    kind = type(default)
    standard = is_dataclass(default) and default == kind()
    return _Name(f"{kind.__name__}()") if standard else default
