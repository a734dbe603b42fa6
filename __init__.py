"""windwrench: a quadrotor that feels the wind.

Importing the package registers the environment ``windwrench/FanTracking-v0`` with Gymnasium.
"""

__version__ = "0.1.0"
