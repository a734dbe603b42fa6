"""The effect library as a page of documentation, made from the library itself:
``python -m windwrench.dynamics.effects`` prints the page.
"""

import math

from ...runtime.page_files import page_template
from . import get, model_in_words, names
from .base import CENTRAL


def effects_page() -> str:
    """Return the page (Markdown) of all effects: model, coefficients, sizes, sources, and the
    flight to distinguish them.
    """
    return page_template(__package__ or "", "page.md.j2", html=False).render(
        effects=[get(name) for name in names()],
        words=model_in_words,
        central=CENTRAL,
        inf=math.inf,
    )


if __name__ == "__main__":
    print(effects_page(), end="")
