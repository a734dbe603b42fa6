"""The ``windwrench`` command, also as ``python -m windwrench``."""

from .runtime.interrupts import leaving_at_once


def main() -> None:
    """Run the command."""
    with leaving_at_once():
        from .cli import main as command
    command()


if __name__ == "__main__":
    main()
