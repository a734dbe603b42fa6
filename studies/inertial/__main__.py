"""``python -m studies.inertial``, the same as ``windwrench inertial``."""

import sys

from windwrench.cli import main

if __name__ == "__main__":
    sys.argv[1:1] = ["inertial"]
    main()
