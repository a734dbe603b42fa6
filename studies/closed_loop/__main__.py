"""``python -m studies.closed_loop``, the same as ``windwrench close-loop``."""

import sys

from windwrench.cli import main

if __name__ == "__main__":
    sys.argv[1:1] = ["close-loop"]
    main()
