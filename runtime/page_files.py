"""The files shown in a page and kept with the page: compact JSON, compressed tables, and one small
picture a figure. The same content gives the same bytes.
"""

import gzip
import io
import json
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .whole_files import replaced

if TYPE_CHECKING:
    from jinja2 import Template
    from matplotlib.figure import Figure

_DPI = 110
_COLOURS = 128  # a picture; lines and their soft edges need no more


@cache
def page_template(package: str, name: str, html: bool = True) -> "Template":
    """Return a package's template: in a page (HTML) every text is escaped, and a missing name is an
    error. Filters: ``g6``, six significant digits; ``toml_float``, the same as TOML's float.
    """
    from jinja2 import Environment, StrictUndefined  # most of the kit writes no page

    source = resources.files(package).joinpath(name).read_text(encoding="utf-8")
    environment = Environment(
        autoescape=html, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["g6"] = lambda x: f"{x:.6g}"
    environment.filters["toml_float"] = lambda x: repr(float(f"{x:.6g}") + 0.0)
    return environment.from_string(source)


def write_json(data: Any, path: Path, allow_nan: bool = False) -> None:
    """Write JSON without spaces, whole or not at all; compressed where the name ends in ``.gz``.

    Raises:
        InputError: the file cannot be written.
        ValueError: a number is not finite, and ``allow_nan`` is not given.
    """
    write_text(json.dumps(data, separators=(",", ":"), allow_nan=allow_nan) + "\n", path)


def write_text(text: str, path: Path) -> None:
    """Write a text, whole or not at all; compressed where the name ends in ``.gz``.

    Raises:
        InputError: the file cannot be written.
    """
    data = text.encode()
    with replaced(path) as partial:
        # no time and no name in the header
        partial.write_bytes(gzip.compress(data, 9, mtime=0) if path.suffix == ".gz" else data)


def write_png(figure: "Figure", path: Path) -> None:
    """Write a figure as a PNG of at most 128 colours, whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    from PIL import Image

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI)
    picture = Image.open(buffer).convert("RGB")
    few = picture.quantize(
        _COLOURS, method=Image.Quantize.MEDIANCUT, kmeans=3, dither=Image.Dither.NONE
    )
    with replaced(path) as partial:
        few.save(partial, format="png", optimize=True)


def write_figure(figure: "Figure", folder: Path, name: str) -> Path:
    """Write NAME.png, for pages, and NAME.svg, ignored by git; return the first's path.

    Raises:
        InputError: a file cannot be written.
    """
    import matplotlib

    path = folder / f"{name}.png"
    write_png(figure, path)
    with (
        matplotlib.rc_context({"svg.hashsalt": "windwrench"}),
        replaced(path.with_suffix(".svg")) as partial,
    ):
        figure.savefig(partial, format="svg", dpi=_DPI, metadata={"Date": None})
    return path
