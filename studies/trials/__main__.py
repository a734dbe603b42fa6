"""``python -m studies.trials``, the same as ``windwrench trials``."""

import sys

from windwrench.cli import main

if __name__ == "__main__":
    sys.argv[1:1] = ["trials"]
    main()
