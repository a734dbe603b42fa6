"""The steps of the demonstration, each with its results in words, a picture and its command."""

import itertools
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..controllers import make_controller
from ..dynamics.vehicle import EffectSetting, Vehicle
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.recording import record_flight
from ..evaluation.episodes import DECISIONS, Episode, fly_episode
from ..evaluation.leaderboard import Standing
from ..evaluation.pictures import draw_episode
from ..identification.diagnosis import diagnose
from ..identification.findings import Diagnosis
from ..identification.logs.flight_log import FlightLog, write_log
from ..identification.report.files import write_report
from ..identification.report.headline import headline
from ..runtime.drawing import AFTER, BEFORE, BLACK, JET, new_figure, room_above, styled
from ..runtime.page_files import write_png
from .steps import Step

CONTROLLER, SCENARIO = "admittance", "base"
LAWS = ("hover", "admittance", "ratio", "oracle")  # on the leaderboard
SECONDS = 25.0  # length of the recorded flight
TRAJECTORY = "excite"

Report = Callable[[float], None]  # takes the share done


@dataclass
class Story:
    """The request, and its steps in order: each returns its results.

    Attributes:
        vehicle: as declared.
        vehicle_name: as typed by a user.
        effect: acts on the true vehicle, missing in the model.
        seed: for all flights.
        episodes: flights before and after the diagnosis.
        out: folder for the results.
        log: the recorded flight.
        diagnosis: the recorded flight's.
        reports: files of the diagnosis.
    """

    vehicle: Vehicle
    vehicle_name: str
    effect: EffectSetting
    seed: int
    episodes: int
    out: Path
    log: FlightLog = field(init=False)
    diagnosis: Diagnosis = field(init=False)
    reports: list[Path] = field(init=False)

    @property
    def effect_words(self) -> str:
        """The effect as typed by a user."""
        coefficients = ",".join(
            f"{name}={value:g}" for name, value in self.effect.coefficients.items()
        )
        return f"{self.effect.name}:{coefficients}"

    def fly_and_feel(self, report: Report) -> list[Step]:
        """Fly one episode in the jet with a true model; compare the estimated wrench with the true
        one.
        """
        env = FanTrackingEnv(SCENARIO, vehicle=self.vehicle)
        episode, still = (
            fly_episode(env, make_controller(law), self.seed, _counted(report, i, 2))
            for i, law in enumerate((CONTROLLER, "hover"))
        )
        picture = self.out / "fly.png"
        draw_episode(episode, f"{CONTROLLER}, {SCENARIO}", picture)
        error = episode.observation[:, :6] - np.hstack([episode.force, episode.torque])
        force, torque = (np.sqrt(np.mean(part**2)) for part in (error[:, :3], error[:, 3:]))
        command = f"windwrench fly --scenario {SCENARIO} --seed {self.seed}"
        if self.vehicle_name != "ardrone2":
            command += f" --vehicle {shlex.quote(self.vehicle_name)}"
        return [
            Step(
                "Fly in the jet of a moving fan",
                (
                    "The vehicle must stay in the jet. Its controller sees the estimated force and "
                    "torque, never the fan.",
                    f"Distance from the axis: {episode.rmse:.2f} m (RMSE over 20 s)"
                    f"{', terminated' if episode.lost else ''}; without the controller "
                    f"{still.rmse:.2f} m.",
                ),
                command,
                picture,
            ),
            Step(
                "Feel the wind",
                (
                    "A Kalman filter estimates force and torque from rotor speeds and pose alone.",
                    f"Error of the estimate: {force:.2f} N and {1e3 * torque:.1f} mNm (RMSE "
                    "over three axes); the jet pushes with up to "
                    f"{np.abs(episode.force[:, 0]).max():.1f} N.",
                ),
                f"{command} --csv",
            ),
        ]

    def record(self, report: Report) -> list[Step]:
        """Fly a vehicle with the effect, and write the log."""
        columns: dict[str, Any] = record_flight(
            self.vehicle, (self.effect,), TRAJECTORY, SECONDS, self.seed, report=report
        )
        for truth in ("force", "torque"):  # not in a real log
            del columns[truth]
        path = self.out / "flight.csv"
        self.log = FlightLog(**columns, name=path.stem, vehicle=self.vehicle.name)
        write_log(self.log, path)
        return [
            Step(
                "Record a flight with a hidden effect",
                (
                    f"The vehicle now has an effect that its model lacks: {self.effect_words}.",
                    f"The vehicle flies {SECONDS:g} s. The log holds times, poses and rotor "
                    "speeds, and no true wrench.",
                ),
                f"windwrench record --vehicle {shlex.quote(self.vehicle_name)} "
                f"--effect {self.effect_words} --trajectory {TRAJECTORY} --seconds {SECONDS:g} "
                f"--seed {self.seed} --out {path}",
            )
        ]

    def find(self, stage: Callable[[str], None]) -> list[Step]:
        """Diagnose the log; write the report and the amended vehicle."""
        folder = self.out / "diagnose"
        command = (
            f"windwrench diagnose {self.out / 'flight.csv'} --vehicle "
            f"{shlex.quote(self.vehicle_name)} --out {folder}"
        )
        self.diagnosis = diagnose([self.log], self.vehicle, (), (), stage)
        self.reports = write_report(self.diagnosis, folder, command)
        sentence = (
            "The diagnosis sees the log and the declared vehicle.",
            headline(self.diagnosis),
            f"True: {self.effect_words}.",
        )
        return [Step("Diagnose it", sentence, command, report="diagnose/report.html")]

    def fly_better(self, report: Report) -> list[Step]:
        """Fly the same episodes with the declared model and with the amended one."""
        count, law = self.episodes, make_controller(CONTROLLER)
        flown: list[Episode] = []
        for model in (self.vehicle, self.diagnosis.amended):
            env = FanTrackingEnv(SCENARIO, vehicle=model, effects=[self.effect], truth=self.vehicle)
            for i in range(count):
                each = _counted(report, len(flown), 2 * count)
                flown.append(fly_episode(env, law, self.seed + i, each))
        before, after = np.reshape([e.rmse for e in flown], (2, count))
        picture = self.out / "before_after.png"
        _draw(flown[0], flown[count], picture)
        return [
            Step(
                "Fly better",
                (
                    f"The same {count} episodes, with the declared model and with the amended "
                    "one. Fan, gusts and noise are the same.",
                    f"Distance from the jet's axis, mean RMSE: {before.mean():.3f} m before, "
                    f"{after.mean():.3f} m after; smaller in {np.sum(after < before)} of {count}.",
                    "Too few episodes for a success rate.",
                ),
                f"windwrench fly --scenario {SCENARIO} --seed {self.seed} --vehicle "
                f"{self.out / 'diagnose' / 'vehicle.yaml'} --truth "
                f"{shlex.quote(self.vehicle_name)} --effect {self.effect_words}",
                picture,
            )
        ]

    def compare(self, rows: Sequence[Standing], folder: Path) -> list[Step]:
        """Return a leaderboard as a step, with its files in a folder."""
        best = ", ".join(f"{r.controller} {r.rmse_m:.3f} m" for r in rows if r.scenario == SCENARIO)
        return [
            Step(
                "Compare controllers",
                (
                    f"{len(LAWS)} controllers fly the same {self.episodes} episodes of each "
                    "scenario. Score 0: hovering; 1: a controller that sees the fan.",
                    f"RMSE on {SCENARIO}: {best}.",
                ),
                f"windwrench benchmark --controllers {','.join(LAWS)} --episodes {self.episodes} "
                f"--seed {self.seed} --out {folder}",
                folder / "leaderboard.png",
                board=rows,
            )
        ]


def _counted(report: Report, done: int, episodes: int) -> Callable[[Any], None]:
    """Return a function to call after each decision of an episode, the ``done``-th."""
    decisions = itertools.count(1)
    return lambda info: report((done + next(decisions) / DECISIONS) / episodes)


@styled()
def _draw(before: Episode, after: Episode, path: Path) -> None:
    figure = new_figure(4.0)
    axes: Any = figure.subplots()
    longest = max((before, after), key=lambda e: len(e.time))
    fan = longest.fan_y
    axes.fill_between(longest.time, fan - 0.45, fan + 0.45, color=JET, label="width of the fan")
    axes.plot(longest.time, fan, "--", color=BLACK, lw=1.5, label="fan")
    axes.plot(before.time, before.y, color=BEFORE, lw=2, label="vehicle, declared model")
    axes.plot(after.time, after.y, color=AFTER, lw=2, label="vehicle, amended model")
    title = f"RMSE {before.rmse:.3f} m before, {after.rmse:.3f} m after"
    axes.set(title=title, xlabel="time (s)", ylabel="y (m)")
    room_above(axes)
    axes.legend(loc="upper left", ncols=2)
    write_png(figure, path)
