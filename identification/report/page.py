"""The page of a diagnosis's report: one self-contained HTML file.

A script and a small library (``uplot/``) draw its plots, with zoom and cursor. In a browser without
scripts, a table of each plot shows the same numbers. The page's policy allows no other script, and
nothing from elsewhere.
"""

import base64
import hashlib
import json
from functools import cache
from importlib import resources

from ... import __version__
from ...runtime.page_files import page_template
from ..findings import Diagnosis
from . import amounts, words
from .headline import headline
from .plot_numbers import candidate_bars, page_plots

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
_TONES = {
    "explained": "good",
    "nothing to explain": "good",
    "partly explained": "warn",
    "unexplained": "bad",
}


def report_page(diagnosis: Diagnosis, command: str) -> str:
    """Return the page (HTML) of a diagnosis and its command line. Every text is escaped: names of
    files come from users.
    """
    plots, bars = page_plots(diagnosis), candidate_bars(diagnosis)
    data = plots.data
    licence, code = (
        page_file(f"uplot/{name}").strip() for name in ("LICENSE", "uPlot.iife.min.js")
    )
    # the library with its mandatory licence
    library, script = f"/*\n{licence}\n*/\n{code}", page_file("page.js")
    shown = {bar.name for bar in bars}
    # the page's content security policy: these scripts, and nothing from outside
    hashes = (
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in (library, script)
    )
    allowed = " ".join(hashes) if data else "'none'"
    return page_template(__package__, "page.html.j2").render(
        found=diagnosis,
        words=words,
        amounts=amounts,
        headline=headline(diagnosis),
        tone=_TONES[diagnosis.verdict],
        table=words.error_table(diagnosis),
        plots=plots,
        bars=bars,
        more_candidates=[c for c in diagnosis.candidates if c.name not in shown],
        policy=f"{_POLICY}; script-src {allowed}",
        # escaped for a page's script element: no tag can begin inside
        data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c") if data else "",
        library=library,
        shared_style=page_file("page.css"),
        library_style=page_file("uplot/uPlot.min.css"),
        script=script,
        command=command,
        version=__version__,
    )


@cache
def page_file(name: str) -> str:
    """Return a text beside this module."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
