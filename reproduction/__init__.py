"""The paper, figure by figure: one file each, run by ``windwrench reproduce``."""

from .ekf import WrenchEKF
from .observer import NonlinearObserver, ObserverTuning

NAMES = ("fig3", "fig4", "fig5", "fig6", "fig7")

__all__ = ["NAMES", "NonlinearObserver", "ObserverTuning", "WrenchEKF"]


def __dir__() -> list[str]:
    return __all__
