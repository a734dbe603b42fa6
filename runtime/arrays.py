"""Arrays by their numbers; shapes stand at each use."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]
