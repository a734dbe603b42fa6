"""From a log to a controller: a Crazyflie is identified from its flights, a regulator designed for
it and a policy trained on it, and both fly the simulated vehicle from a C program.

The C runs on a Cortex-M4F under qemu, or without qemu on this machine. The flights are log10,
log15 and log16 of github.com/arplaboratory/data-driven-system-identification.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import typer

from windwrench.cli import app
from windwrench.envs import Stage, WindHoverEnv
from windwrench.evaluation.episodes import benchmark_seeds, fly_episode
from windwrench.evaluation.statistics import hierarchical_bootstrap, mean
from windwrench.evaluation.tasks import make_pilot

PARTS = ("log10:8.67-38.67", "log15:15.76-50.76", "log16:15.1-21.1", "log16:28.1-32.1")
BOARD = Path(__file__).resolve().parent / "board"
ARM = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-nostartfiles")
ARM += ("-T", str(BOARD / "mps2_an386.ld"))
QEMU = "qemu-system-arm -machine mps2-an386 -display none -monitor none -serial none "
QEMU += "-semihosting-config enable=on,target=native -kernel"
LAWS = {"lqg": 1, "policy": 2}  # WW_LQG and WW_LEARNED


class Hover(WindHoverEnv):
    """The identified vehicle in the wind; the true one is drawn anew each episode."""

    vehicle, randomise = "cf.yaml", "vehicle"


class Rates(Hover):
    """The same, with body rates and thrust as actions."""

    action, observation, normalize = "rates", "wrench", True


class Aboard:
    """The C program in place of the simulator's filter and flight loop."""

    def __init__(self, folder: Path, law: int) -> None:
        self.law, self.rng = law, np.random.default_rng(0)
        on_board = bool(shutil.which("qemu-system-arm") and shutil.which("arm-none-eabi-g++"))
        prefix, options = ("arm-none-eabi-", ARM) if on_board else ("", ())
        program, objects = folder / "flight", []
        for compiler, source in (("gcc", BOARD / "flight.c"), ("g++", folder / "windwrench.cpp")):
            objects.append(str(folder / f"{source.stem}.o"))
            words = [prefix + compiler, "-O2", "-fno-math-errno", *options[:4], "-I", str(folder)]
            words += ["-fno-exceptions", "-fno-rtti"] if compiler == "g++" else []
            subprocess.run([*words, "-c", str(source), "-o", objects[-1]], check=True)
        linker = [f"{prefix}gcc", *options, *objects, "-o", str(program), "-lm", "-lc"]
        subprocess.run(linker, check=True)
        self.machine = "a Cortex-M4F under qemu" if on_board else "this machine"
        self.run = subprocess.Popen(
            [*(QEMU.split() if on_board else []), str(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self.stages = [
            Stage("begin", self.begin, before="sense"),
            Stage("aboard", self.steer, before="actuate"),
        ]

    def ask(self, loop, law, accelerometer=(0.0, 0.0, 0.0)):
        """Send a step; return the rotor speeds (4,) rad/s."""
        step = [*loop.sample, *accelerometer, *loop.setpoint[:10], law]
        self.run.stdin.write(np.array(step, dtype=np.float32).tobytes())
        self.run.stdin.flush()
        return np.frombuffer(self.run.stdout.read(16), dtype=np.float32)

    def begin(self, loop):
        """Begin a flight, 1.5 s before the episode."""
        if loop.ticks == -300:
            self.ask(loop, -1)

    def steer(self, loop):
        """Fly a tick: by the flight loop alone until the episode begins, then by the law."""
        record, plant = loop.record[0], loop.record[0]["plant"]
        felt = plant["rotation"].T @ loop.world.xfrc[:3] / loop.model.body("vehicle").mass
        noise = record["accelerometer_sigma"] * self.rng.standard_normal(3)
        law = self.law if loop.ticks >= 0 else 0
        loop.command[:] = self.ask(loop, law, felt + record["accelerometer_bias"] + noise)


def flown(name, env, law, episodes, seed=6900):
    """Fly test episodes; print and return the RMSE (n,) m after 3 s."""
    pilot = make_pilot(law, f"{__file__}:{'Rates' if law.endswith('.npz') else 'Hover'}")
    some = [fly_episode(env, pilot, each) for each in benchmark_seeds(seed, episodes)]
    errors = np.array([one.rmse_settled for one in some])
    low, high = hierarchical_bootstrap(mean, errors[None])
    lost = sum(one.lost for one in some)
    middle = np.median(errors)
    print(
        f"{name:12} {errors.mean():.3f} m (95 %: {low:.3f} to {high:.3f}), median {middle:.3f} m, "
        f"{lost} of {episodes} lost"
    )
    return errors


def main(
    logs: Path = Path("."),
    steps: int = 1_000_000,
    episodes: int = 40,
    aboard: int = 5,
    parts: str = ",".join(PARTS),
) -> dict[str, np.ndarray]:
    """Walk from the logs to the flights of the C program; all files go to this folder."""
    words = [str(logs / part) for part in parts.split(",")]
    task, best = f"{__file__}:Rates", "results/rates/best.npz"
    walk = (
        ["identify", *words, "--mass", "0.027", "--geometry", "0.028", "--out", "cf.yaml"],
        [
            *("train", "ppo", "--task", task, "--set", "estimator=ukf-lanes"),
            *("--steps", str(steps), "--set", "validation={every: 100000, episodes: 10}"),
            *("--out", "results/rates"),
        ],
        [
            *("export-c", "--vehicle", "cf.yaml", "--controller", "lqg", "--policy", best),
            *("--rise-time", "0.45", "--out", "aboard", "--overwrite"),
        ],
    )
    for command in walk:
        print("$ windwrench", *command)
        app(command, standalone_mode=False)
    found = {law: flown(law, Hover(), law, episodes) for law in ("pid-force", "lqg")}
    found["policy"] = flown("policy", Rates(), best, episodes)
    for law, number in LAWS.items():
        board = Aboard(Path("aboard"), number)
        env = Hover(stages=board.stages)
        found[f"{law} in C"] = flown(f"{law} in C", env, "hover", aboard)
        print(f"  on {board.machine}; in Python {found[law][:aboard].mean():.3f} m")
        board.run.stdin.close()  # ends the program
        board.run.wait()
    return found


if __name__ == "__main__":
    typer.run(main)
