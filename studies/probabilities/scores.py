"""What the probabilities of ranked flights are worth."""
from collections.abc import Mapping
from typing import Any
def tables(outcomes: Mapping[Any, Any]) -> str:
    return str(len(outcomes))
