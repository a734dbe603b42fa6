"""Write each script of ``notebooks/`` as a Jupyter notebook with its outputs, without Jupyter.

The scripts are the source: run this after an edit of a script. The tests compare both.

Run:  python examples/render_notebooks.py
"""

import base64
import contextlib
import io
import json
import os
import re
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

FOLDER = Path(__file__).with_name("notebooks")


def cells(script):
    """Yield (kind, text) of each cell of a script with ``# %%`` lines; kind: markdown or code."""
    marks = r"^# %%( \[markdown\])?$"
    _, *rest = re.split(marks, script.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for mark, text in zip(rest[::2], rest[1::2], strict=True):
        if mark:
            yield "markdown", re.sub(r"(?m)^# ?", "", text).strip()
        else:
            yield "code", text.strip()


def figures():
    """Return the open figures as Jupyter shows them, and close them."""
    shown = []
    for number in plt.get_fignums():
        picture = io.BytesIO()
        plt.figure(number).savefig(picture, format="png", dpi=80)
        png = base64.b64encode(picture.getvalue()).decode()
        shown.append({"output_type": "display_data", "data": {"image/png": png}, "metadata": {}})
    plt.close("all")
    return shown


def notebook(script, names):
    """Run a script's cells in the current folder and return its notebook (nbformat 4.5).

    Args:
        script: path.
        names: filled with the names that the cells define.
    """
    written = []
    for number, (kind, text) in enumerate(cells(script)):
        cell = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}}
        cell["source"] = text.splitlines(keepends=True)
        if kind == "code":
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile(text, f"{script.name}, cell {number}", "exec"), names)
            lines = printed.getvalue().splitlines(keepends=True)
            stream = {"output_type": "stream", "name": "stdout", "text": lines}
            outputs = [*([stream] if lines else []), *figures()]
            cell |= {"execution_count": None, "outputs": outputs}
        written.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {
        "cells": written,
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def main(folder=FOLDER):
    """Write a notebook beside each script of a folder."""
    plt.switch_backend("Agg")
    for script in sorted(folder.glob("*.py")):
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as empty:
            os.chdir(empty)
            try:
                made = notebook(script.resolve(), {"__name__": "__main__"})
            finally:
                os.chdir(before)
        path = script.with_suffix(".ipynb")
        path.write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(f"wrote {path.name}")


if __name__ == "__main__":
    main()
