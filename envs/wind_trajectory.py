"""Flying a trajectory in the wind."""

from .wind_tasks import WindEnv


class WindTrajectoryEnv(WindEnv):
    """A quadrotor must fly figures of eight and random splines through turbulence and jets.

    ## Description

    A quadrotor follows a reference through a sheared mean wind with turbulence, through the jets of a
    wall of 3 x 3 fans that switch by themselves, through gusts, or below another vehicle: what blows is its
    scenario's. The reference is a lying figure of eight (1.0-1.4 m along, 0.4-0.6 m across, in 6-9 s, turned by
    any angle) or a spline through random points of a box of 2.4 x 2.4 x 0.8 m, one every 1.5-2.2 s; it gets up
    to speed in 1.5 s. The flight loop is given its position, velocity and acceleration. An unscented Kalman filter turns rotor speeds and motion-capture pose into the
    external force and torque, at 200 Hz, and a flight loop (position, velocity, a weak integral,
    attitude) flies to the reference by the estimated state. The agent commands an acceleration
    beside the flight loop's own, 25 times a second: it must cancel what the wind does before the
    flight loop's error grows. The wind acts at 12 stations of the vehicle, each in its own air.

    ## Action space

    ``Box(-4, 4, (3,), float32)``; with ``normalize=True`` ``Box(-1, 1, (3,), float32)``, in units of
    4 m/s2

    | Num | Action                                           | Min | Max | Unit |
    | --- | ------------------------------------------------ | --- | --- | ---- |
    | 0-2 | acceleration x, y, z (world) beside the flight loop's | -4  | 4   | m/s2 |

    An action out of range is clipped; one that is not finite raises ``InputError``. The flight loop
    limits its tilt to 0.5 rad.

    ## Observation space

    ``Box(-limit, limit, (27,), float32)``, in SI units, world axes; with ``normalize=True`` divided by
    the scale

    | Num   | Observation                                             | Limit | Scale | Unit |
    | ----- | ------------------------------------------------------- | ----- | ----- | ---- |
    | 0-2   | reference less estimated position                        | 5     | 0.2   | m    |
    | 3-5   | estimated velocity                                       | 10    | 1     | m/s  |
    | 6-8   | velocity of the reference                                | 10    | 1     | m/s  |
    | 9-11  | acceleration of the reference                            | 20    | 2     | m/s2 |
    | 12-14 | estimated external force                                 | 10    | 1     | N    |
    | 15-17 | estimated external torque                                | 1     | 0.03  | Nm   |
    | 18-20 | specific force of an accelerometer, mean over the 40 ms  | 40    | 10    | m/s2 |
    | 21-23 | specific force of the rotors by the declared model, likewise | 40 | 10    | m/s2 |
    | 24-26 | last action                                              | 4     | 4     | m/s2 |

    The accelerometer sits in the centre of mass and has a noise of 0.15 m/s2 a tick (5 ms) and a bias of
    0.05 m/s2, drawn each episode; it is turned into the world by the estimated attitude. The filter does
    not use it. Wind and true force are not observed: ``info`` has them.

    ## Rewards

    ``reward = reward_tracking + reward_change``, each of them in ``info``:

    * ``reward_tracking = 1 / (1 + (error / 0.1)^2)``, where ``error`` is the true distance from the
      reference, in m;
    * ``reward_change = -0.002 |action - last action|^2``, with actions in m/s2.

    ## Starting state

    The vehicle hovers at the start of the reference, 2.3 m in front of the wall and 1.5 m high, facing
    it, for 1.5 s in the wind of time 0, in which the filter settles. Winds, reference and all noise are
    drawn from the seed; winds in which the vehicle is lost before the episode begins are drawn anew.

    ## Episode end

    Terminated when the vehicle is lost: 2.5 m from the reference, on the floor, or tilted by more than
    70 degrees. Truncated after 20 s (500 decisions).

    ## Arguments

    ```python
    gym.make("windwrench/WindTrajectory-v0", scenario="base", render_mode=None)
    ```

    | Parameter     | Default      | Description                                                          |
    | ------------- | ------------ | -------------------------------------------------------------------- |
    | `scenario`    | `"base"`     | one of `windwrench.envs.wind_scenarios.WIND_SCENARIOS`, or a `WindScenario` |
    | `vehicle`     | `"ardrone2"` | preset, YAML path or `Vehicle`: what filter and flight loop know       |
    | `effects`     | `()`         | effects of the true vehicle that nobody declared                      |
    | `truth`       | `None`       | the true vehicle, before `effects`; default: as declared               |
    | `winds`       | `None`       | winds of `windwrench.envs.wind`, in place of the scenario's            |
    | `settings`    | `None`       | a `PlantSettings`: motor lag, unmodelled disturbance, dropouts        |
    | `estimator`   | `"ukf"`      | `"ukf"`, or `"constant-gain"`: the filter's converged gain             |
    | `normalize`   | `False`      | whether observations and actions are divided by the scales above      |
    | `model_in_loop` | `True`     | whether the flight loop counters the effects that `vehicle` declares    |
    | `gains`       | `None`       | a `FlightGains`: of the flight loop                                    |
    | `render_mode` | `None`       | `"human"` (needs a display) or `"rgb_array"`                          |

    ``reset`` knows no ``options`` and refuses any.

    ## Version history

    * v0: initial version.
    """  # noqa: E501

    name = "WindTrajectory"
    moving = True
