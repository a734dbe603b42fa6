"""The effect library as a page of documentation, made from the library itself:
``python -m windwrench.dynamics.effects`` prints the page.
"""

from . import Coefficient, Effect, get, model_in_words, names
from .base import CENTRAL

_HEAD = f"""# The effects

The simulator applies an effect, the estimator's model includes it once it is declared, and the diagnosis fits it to the residual of a
log. Each is one file in `dynamics/effects/`. This page is made from those files:

    python -m windwrench.dynamics.effects > docs/effects.md

A vehicle declares effects in its YAML file, `effects: [{{name: rotor_drag, coefficients: {{kdx: 1.2e-4, kdy: 1.2e-4}}}}]`;
`windwrench record --effect rotor_drag:kdx=1.2e-4,kdy=1.2e-4` flies one that the vehicle does not declare. Coefficients not given are
zero. World z is up; body x points forward, y left.

The *kind* says what an effect changes. *Rotor input*: what the rotors deliver. *Wrench*: force and torque. *Body*: the rigid
body. *Sensing*: what the log holds. The *role* is what other effects know it by, and *needs* is what a log must hold to show it. A
diagnosis goes by these words and not by the name. It computes from the flights which effects can be confused:
`indistinguishable_from` in a report.

Of each coefficient stand its typical sizes for vehicles of 0.45 kg and of 0.03 kg, and its range. `central` is the same in all
effects that act rotor by rotor. {CENTRAL.meaning}.

"""


def effects_page() -> str:
    """Return the page (Markdown) of all effects: model, coefficients, sizes, sources, and what
    distinguishes them.
    """
    families: dict[str, list[str]] = {}
    for name in names():
        families.setdefault(get(name).family, []).append(f"[{name}](#{name})")
    parts = [_HEAD, "| family | effects |\n| --- | --- |\n"]
    parts += [f"| {family} | {', '.join(links)} |\n" for family, links in sorted(families.items())]
    for name in names():
        effect = get(name)
        model = model_in_words(name).replace("``", "`")
        parts.append(f"\n## {name}\n\n{model}\n\n")
        parts += [_line(c) for c in effect.coefficients if c != CENTRAL]
        parts.append(
            f"\n{_declarations(effect)} Source: {effect.source}.\n\n"
            f"Distinguished by: {effect.excitation}.\n"
        )
    return "".join(parts)


def _line(c: Coefficient) -> str:
    """Return a coefficient as an item of a list."""
    unit = "" if c.unit == "1" else f" {c.unit}"
    sizes = " and ".join(dict.fromkeys(f"{size:g}" for size in c.typical))
    return f"* `{c.name}`: {c.meaning}; typically {sizes}{unit}, {_span(c.minimum, c.maximum)}\n"


def _declarations(effect: Effect) -> str:
    """Return what an effect declares, as one line."""
    parts = [f"Kind: {effect.kind}"]
    if effect.role is not None:
        parts.append(f"Role: {effect.role}")
    if CENTRAL in effect.coefficients:
        parts.append("Has `central`")
    if effect.needs:
        parts.append(f"Needs: {', '.join(effect.needs)}")
    if effect.starting_points is not None:
        parts.append("A fit starts from several points")
    return ". ".join(parts) + "."


def _span(minimum: float, maximum: float) -> str:
    low, high = abs(minimum) != float("inf"), abs(maximum) != float("inf")
    if low and high:
        return f"from {minimum:g} to {maximum:g}"
    return f"at least {minimum:g}" if low else f"at most {maximum:g}" if high else "any size"


if __name__ == "__main__":
    print(effects_page(), end="")
