"""The house style of pictures: letters that can be read, and the colours of a report's page."""

import matplotlib

from tests.support.paths import ROOT
from windwrench.runtime.drawing import AFTER, BEFORE, HELD_OUT, WIDTH, styled

SHOWN = 750  # px, of a picture in a page
SIZES = ("font.size", "axes.labelsize", "axes.titlesize", "legend.fontsize", "xtick.labelsize")


def test_the_smallest_letters_are_9_px_where_a_page_shows_them():
    with styled():
        least = min(matplotlib.rcParams[name] for name in SIZES)
    assert least / 72 * SHOWN / WIDTH >= 9.0
    assert matplotlib.rcParams["legend.fontsize"] == "medium"


def test_the_colours_of_pictures_are_those_of_the_report():
    page = (ROOT / "identification/report/page.html.j2").read_text(encoding="utf-8")
    assert f"--before: {BEFORE}; --after: {AFTER};" in page
    assert f"--held: {HELD_OUT};" in page
