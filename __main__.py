"""``python -m windwrench`` is the ``windwrench`` command."""

from .cli import main

if __name__ == "__main__":
    main()
