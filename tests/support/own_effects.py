"""Effects of a user's own, and the library under other names."""

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from windwrench.dynamics import effects

# an effect that does nothing while one coefficient is zero; "# more" is where it may say more
HOSE = '''"""A pull that comes and goes."""

import math

from windwrench.dynamics.effects.base import Coefficient, Effect


def model(c, vehicle, state, wrench):
    wrench.force[0] += c[0] * math.sin(c[1] * state.time)


EFFECT = Effect(
    name="hose",
    kind="wrench",
    coefficients=(
        Coefficient("a", "N", (0.2, 0.02), "pull"),
        Coefficient("w", "rad/s", (3.0, 3.0), "frequency"),
    ),
    source="test",
    excitation="any flight",
    model=model,
    # more
)
'''


def forget():
    """Let the library be read anew."""
    for known in (effects._files_in, effects.names, effects.get):
        if hasattr(known, "cache_clear"):
            known.cache_clear()


@contextmanager
def joined(folder):
    """A library that a folder of a user's has joined."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WINDWRENCH_EFFECTS", str(folder))
        forget()
        yield
    forget()


@contextmanager
def renamed(new):
    """A library in which every effect has another name, and no other; yields the new names."""
    own = {name: effects.get(name) for name in effects.names()}
    held = {new(name): replace(effect, name=new(name)) for name, effect in own.items()}
    folder = Path(effects.__file__).parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effects, "_files", lambda: {name: folder / f"{name}.py" for name in held})
        patch.setattr(effects, "_module", lambda name: SimpleNamespace(EFFECT=held[name]))
        forget()
        yield {name: new(name) for name in own}
    forget()
