"""``python -m studies.measured_flights``, the same as ``windwrench real-flights``."""

import sys

from windwrench.cli import main

if __name__ == "__main__":
    sys.argv[1:1] = ["real-flights"]
    main()
