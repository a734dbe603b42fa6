"""A Crazyflie's log as lines of JSON (cflib is on PyPI).

python examples/live_crazyflie.py radio://0/80 | windwrench live - --vehicle crazyflie --map cflib
"""

import contextlib
import json
import sys

import cflib.crtp
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.utils.encoding import decompress_quaternion


def main(uri="radio://0/80/2M/E7E7E7E7E7"):
    """Print a row every 10 ms."""
    cflib.crtp.init_drivers()
    with SyncCrazyflie(uri) as crazyflie:
        # cflib's close would stop the motors
        crazyflie.cf.commander.send_setpoint = lambda *setpoint: None
        motors = "rpm" if crazyflie.cf.log.toc.get_element("rpm", "m1") else "motor"
        block = LogConfig("row", period_in_ms=10)  # 26 bytes, as many as fit
        for axis in "xyz":
            block.add_variable(f"stateEstimate.{axis}", "float")
        block.add_variable("stateEstimateZ.quat", "uint32_t")
        for i in range(1, 5):
            block.add_variable(f"{motors}.m{i}", "uint16_t")
        block.add_variable("pm.vbat", "FP16")
        with SyncLogger(crazyflie, block) as log:
            for milliseconds, row, _ in log:
                quaternion = decompress_quaternion(row.pop("stateEstimateZ.quat"))
                row |= {f"stateEstimate.q{'xyzw'[i]}": float(quaternion[i]) for i in range(4)}
                print(json.dumps({"timestamp": milliseconds, **row}), flush=True)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(*sys.argv[1:])
