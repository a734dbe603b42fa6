"""Which function trains what a configuration describes."""

from collections.abc import Callable
from pathlib import Path

from .configuration import Config
from .run import Progress


def run_training(
    config: Config,
    scenario: str,
    seed: int,
    folder: Path,
    advance: Callable[[int], None] = lambda steps: None,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Path:
    """Train a policy by the algorithm of its configuration; return the path of the best one.

    Arguments and errors are those of ``train.train``.
    """
    if config["algorithm"] == "imitation":
        from .imitate import imitate as work
    elif config["algorithm"] == "recurrent-imitation":
        from .recurrent_imitation import recurrent_imitation as work
    else:
        from .train import train as work
    return work(config, scenario, seed, folder, advance, report)
