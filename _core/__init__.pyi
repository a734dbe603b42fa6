"""The compiled core: what is computed at every step."""

def instruction_set() -> str:
    """Return the instruction set that the core was built for: baseline, avx2 or avx512."""
