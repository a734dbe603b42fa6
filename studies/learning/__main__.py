"""``python -m studies.learning``, the same as ``windwrench leaderboard``."""

import sys

from windwrench.cli import main

if __name__ == "__main__":
    sys.argv[1:1] = ["leaderboard"]
    main()
