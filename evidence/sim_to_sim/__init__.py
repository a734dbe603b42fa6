"""The kit's hover in the wind, flown in other people's simulators."""

import os

os.environ.setdefault("SCIPY_ARRAY_API", "1")  # crazyflow refuses a scipy that came without it
