"""``python -m studies.pipeline_picture`` draws the steps of the diagnosis for its page."""

from pathlib import Path

from windwrench.runtime.page_files import write_png

STEPS = (  # what each box says: its name, and what it does, in lines
    ("Log and vehicle", "pose, rotor speeds;\nmass, inertia, effects"),
    ("1 Check", "units, frames, order\nof rotors and clock"),
    ("2 Residual", "needed by the motion\nless given by the model"),
    ("3 Noise floor", "what the sensors'\nnoise would leave"),
    ("4 Search", "effects of the library,\nstepwise regression"),
    ("5 Innovations", "effect, or correlation\nthrough the flight loop?"),
    ("6 Alternatives", "what else would fit\nthese logs as well"),
    ("7 Structure", "does the residual still\ndepend on the flight?"),
    ("8 Held-out blocks", "errors before and after"),
    ("Report", "names, coefficients,\nhow sure, what to fly"),
)
_COLUMNS = 5
_WIDTH, _HEIGHT, _GAP = 1.9, 0.95, 0.42  # in
_DATA, _STEP, _LINE = "#e6edda", "#e3eef6", "#5d6675"


def main(path: Path = Path("docs/images/pipeline.png")) -> None:
    """Draw the boxes in two rows, each with an arrow to the next, and write the picture."""
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyBboxPatch

    size = _COLUMNS * _WIDTH + (_COLUMNS - 1) * _GAP, 2 * _HEIGHT + _GAP
    figure = Figure(figsize=(size[0] + 0.2, size[1] + 0.2))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-0.1, size[0] + 0.1), ylim=(-0.1, size[1] + 0.1))
    axes.axis("off")
    centres = []
    for i, (name, what) in enumerate(STEPS):
        row, column = divmod(i, _COLUMNS)
        place = column * (_WIDTH + _GAP), (1 - row) * (_HEIGHT + _GAP)
        colour = _DATA if i in (0, len(STEPS) - 1) else _STEP
        axes.add_patch(
            FancyBboxPatch(
                place,
                _WIDTH,
                _HEIGHT,
                boxstyle="round,pad=0,rounding_size=0.08",
                facecolor=colour,
                edgecolor=_LINE,
            )
        )
        x, y = place[0] + _WIDTH / 2, place[1]
        axes.text(x, y + 0.74 * _HEIGHT, name, ha="center", va="center", weight="bold", size=11)
        axes.text(x, y + 0.33 * _HEIGHT, what, ha="center", va="center", size=9)
        centres.append((x, y + _HEIGHT / 2))
    arrow = {"arrowstyle": "-|>", "color": _LINE, "lw": 1.4}
    for i in range(len(STEPS) - 1):
        (x0, y0), (x1, y1) = centres[i], centres[i + 1]
        if y0 == y1:
            ends = (x1 - _WIDTH / 2, y1), (x0 + _WIDTH / 2, y0)
        else:  # down, and back to the left, in the gap between the rows
            middle = _HEIGHT + _GAP / 2
            axes.plot([x0, x0, x1], [y0 - _HEIGHT / 2, middle, middle], color=_LINE, lw=1.4)
            ends = (x1, y1 + _HEIGHT / 2), (x1, middle)
        axes.annotate("", xy=ends[0], xytext=ends[1], arrowprops={**arrow, "shrinkA": 0})
    write_png(figure, path)


if __name__ == "__main__":
    main()
