"""The compiled core; all else is in pyproject.toml."""

import sys

sys.path.insert(0, "installation")

from build_core import BuildCore, extensions
from setuptools import setup

setup(ext_modules=extensions(), cmdclass={"build_ext": BuildCore})
