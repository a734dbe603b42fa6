"""The site shows the results of a page first: the line that says which command made them, where it
opens a page, comes last.
"""

import re
from typing import Any

_OPENING = re.compile(r"^Made by `[^`]+`, windwrench [^\n]*\.\n\n", re.MULTILINE)


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Move the line from above the first section, or from right below its heading, to the end."""
    found = _OPENING.search(markdown)
    if found is None or markdown.count("\n#", 0, found.start()) > 1:
        return markdown
    rest = markdown[: found.start()] + markdown[found.end() :]
    return f"{rest.rstrip()}\n\n---\n\n{found[0]}"
