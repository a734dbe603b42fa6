"""Arrays by their numbers; shapes stand at each use."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]
Single = NDArray[np.float32]
Floats = NDArray[np.floating[Any]]
Picture = NDArray[np.uint8]
