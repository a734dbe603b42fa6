"""A digest of the code that made a result: results of other code are not comparable, and not
reused.
"""

from windwrench.runtime.code_digest import code_digest

_ROOMS = ("runtime", "dynamics", "estimator", "controllers", "identification", "envs")


def code_stamp(*modules: str) -> str:
    """Return a digest (16 hexadecimal digits) of all rooms that fly and diagnose, and of these
    modules of the studies.

    Args:
        modules: paths below this folder without their ending, such as ``trials/outsiders``.
    """
    return code_digest(_ROOMS, tuple(f"studies/{name}.py" for name in modules))
