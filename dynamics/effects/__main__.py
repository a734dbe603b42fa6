"""The effect library as a page of documentation, made from the library itself:
``python -m windwrench.dynamics.effects`` prints the page.
"""

from . import Effect, get, model_in_words, names

_HEAD = """# The effects

One effect, three uses: the simulator applies it, the estimator's model includes it once it is declared, and the diagnosis fits it
to the residual of a log. Each is one file in `dynamics/effects/`, which holds its model, the equation, once. This page is made from
those files:

    python -m windwrench.dynamics.effects > docs/effects.md

A vehicle declares effects in its YAML file, `effects: [{name: rotor_drag, coefficients: {kdx: 1.2e-4, kdy: 1.2e-4}}]`;
`windwrench record --effect rotor_drag:kdx=1.2e-4,kdy=1.2e-4` flies one that the vehicle does not declare. Coefficients not given are
zero. Kinds: *rotor input* changes what the rotors deliver, *wrench* adds force and torque, *body* changes the rigid
body, *sensing* changes what the log holds. World z is up; body x points forward, y left.

An effect declares what it is, and a diagnosis goes by that, not by its name. It declares its *family* and the *role* in which other
effects know it. It also declares what logs must hold to show it. What
can be confused in given flights is computed from them: `indistinguishable_from` in a report.

"""


def effects_page() -> str:
    """Return the page (Markdown) of all effects: model, coefficients, sizes, sources, and what
    distinguishes them.
    """
    parts = [
        _HEAD,
        "| effect | kind | family | coefficients |\n| --- | --- | --- | --- |\n",
    ]
    for name in names():
        effect = get(name)
        parts.append(
            f"| [{name}](#{name}) | {effect.kind} | {effect.family} | "
            f"{', '.join(c.name for c in effect.coefficients)} |\n"
        )
    for name in names():
        effect = get(name)
        model = model_in_words(name).replace("``", "`")
        parts.append(
            f"\n## {name}\n\n{model}\n\n{_declarations(effect)}\n\n"
            "| coefficient | unit | typical, 0.45 kg | typical, 0.03 kg | range | meaning |\n"
            "| --- | --- | --- | --- | --- | --- |\n"
        )
        for c in effect.coefficients:
            parts.append(
                f"| {c.name} | {c.unit} | {c.typical[0]:g} | {c.typical[1]:g} | "
                f"{_span(c.minimum, c.maximum)} | "
                f"{c.meaning} |\n"
            )
        parts.append(f"\nSource: {effect.source}.\n\nDistinguished by: {effect.excitation}.\n")
    return "".join(parts)


def _declarations(effect: Effect) -> str:
    """Return what an effect declares, as one line."""
    parts = [f"Kind: {effect.kind}", f"Family: {effect.family}"]
    if effect.role is not None:
        parts.append(f"Role: {effect.role}")
    if effect.needs:
        parts.append(f"Needs: {', '.join(effect.needs)}")
    if effect.starting_points is not None:
        parts.append("A fit starts from several points")
    return ". ".join(parts) + "."


def _span(minimum: float, maximum: float) -> str:
    low, high = abs(minimum) != float("inf"), abs(maximum) != float("inf")
    if low and high:
        return f"{minimum:g} to {maximum:g}"
    return f"at least {minimum:g}" if low else f"at most {maximum:g}" if high else "any"


if __name__ == "__main__":
    print(effects_page(), end="")
