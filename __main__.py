"""The ``windwrench`` command, also as ``python -m windwrench``."""

import gc

from .runtime.interrupts import leaving_at_once


def main() -> None:
    """Run the command."""
    # imports and arrays make hardly a cycle: a search at every 700 objects takes a twentieth of a
    # diagnosis
    gc.set_threshold(50_000)
    with leaving_at_once():
        from .cli import main as command
    command()


if __name__ == "__main__":
    main()
