"""The steps of the demonstration, each with what it found, in words, a picture and its command."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
LAWS = ("hover", "admittance", "ratio", "oracle")  # of the leaderboard
SECONDS = 25.0  # of the flight that is diagnosed
TRAJECTORY = "excite"

Report = Callable[[float], None]  # takes the share that is done


@dataclass(frozen=True)
class Request:
    """What is asked for.

    Attributes:
        vehicle: as declared.
        vehicle_name: what a user types for it.
        effect: that the true vehicle has and its model lacks.
        seed: of all flights.
        episodes: flights before and after the diagnosis.
        out: folder for the results.
    """

    vehicle: Vehicle
    vehicle_name: str
    effect: EffectSetting
    seed: int
    episodes: int
    out: Path

    @property
    def effect_words(self) -> str:
        """The effect as a user types it."""
        given = ",".join(f"{name}={value:g}" for name, value in self.effect.coefficients.items())
        return f"{self.effect.name}:{given}"


def _fly(
    env: FanTrackingEnv, seeds: list[int], report: Report, controller: str = CONTROLLER
) -> list[Episode]:
    flown: list[Episode] = []
    done = 0

    def each(info: dict[str, Any]) -> None:
        nonlocal done
        done += 1
        report(done / (DECISIONS * len(seeds)))

    for i, seed in enumerate(seeds):
        flown.append(fly_episode(env, make_controller(controller), seed, each))
        done = DECISIONS * (i + 1)
    return flown


def fly_and_feel(request: Request, report: Report) -> list[Step]:
    """Fly one episode in the jet with a true model; compare the estimated wrench with the true
    one.
    """
    env = FanTrackingEnv(SCENARIO, vehicle=request.vehicle)
    (episode,) = _fly(env, [request.seed], lambda share: report(share / 2))
    (still,) = _fly(env, [request.seed], lambda share: report(0.5 + share / 2), "hover")
    picture = request.out / "fly.png"
    draw_episode(episode, f"{CONTROLLER}, {SCENARIO}", picture)
    error = np.column_stack(
        [
            episode.observation[:, :3] - episode.force,
            1e3 * (episode.observation[:, 3:6] - episode.torque),
        ]
    )
    force, torque = (float(np.sqrt(np.mean(part**2))) for part in (error[:, :3], error[:, 3:]))
    command = f"windwrench fly --scenario {SCENARIO} --seed {request.seed}"
    if request.vehicle_name != "ardrone2":
        command += f" --vehicle {shlex.quote(request.vehicle_name)}"
    return [
        Step(
            "Fly in the jet of a moving fan",
            (
                "The vehicle must stay in the jet. Its controller sees the estimated force and "
                "torque, never the fan.",
                f"It keeps {episode.rmse:.2f} m from the axis (RMSE over 20 s)"
                f"{', and is lost' if episode.lost else ''}; a vehicle that hovers on the spot "
                f"{still.rmse:.2f} m.",
            ),
            command,
            picture,
        ),
        Step(
            "Feel the wind",
            (
                "A Kalman filter estimates force and torque from rotor speeds and pose alone.",
                f"On this flight its error is {force:.2f} N and {torque:.1f} mNm (RMSE over the "
                f"three axes); the jet pushes with up to "
                f"{np.abs(episode.force[:, 0]).max():.1f} N.",
            ),
            f"{command} --csv",
        ),
    ]


def record(request: Request, report: Report) -> tuple[Step, FlightLog]:
    """Fly a vehicle that has the effect, and write the log."""
    columns: dict[str, Any] = record_flight(
        request.vehicle, (request.effect,), TRAJECTORY, SECONDS, request.seed, report=report
    )
    for truth in ("force", "torque"):  # which no real log has
        del columns[truth]
    path = request.out / "flight.csv"
    log = FlightLog(**columns, name=path.stem, vehicle=request.vehicle.name)
    write_log(log, path)
    command = (
        f"windwrench record --vehicle {shlex.quote(request.vehicle_name)} "
        f"--effect {request.effect_words} --trajectory {TRAJECTORY} --seconds {SECONDS:g} "
        f"--seed {request.seed} --out {path}"
    )
    return Step(
        "Record a flight with a hidden effect",
        (
            f"The vehicle now has an effect that its model lacks: {request.effect_words}.",
            f"It flies {SECONDS:g} s and writes its log. The log holds times, poses and rotor "
            f"speeds, and not the answer.",
        ),
        command,
    ), log


def find(
    request: Request, log: FlightLog, stage: Callable[[str], None]
) -> tuple[Step, Diagnosis, list[Path]]:
    """Diagnose the log; write the report and the amended vehicle."""
    folder = request.out / "diagnose"
    command = (
        f"windwrench diagnose {request.out / 'flight.csv'} --vehicle "
        f"{shlex.quote(request.vehicle_name)} --out {folder}"
    )
    found = diagnose([log], request.vehicle, (), (), stage)
    written = write_report(found, folder, command)
    return (
        Step(
            "Diagnose it",
            (
                "The diagnosis sees the log and the declared vehicle.",
                headline(found),
                f"True: {request.effect_words}.",
            ),
            command,
            report="diagnose/report.html",
        ),
        found,
        written,
    )


def fly_better(request: Request, found: Diagnosis, report: Report) -> Step:
    """Fly the same episodes with the declared model and with the amended one."""
    seeds = [request.seed + i for i in range(request.episodes)]
    flown: list[list[Episode]] = []
    for i, model in enumerate((request.vehicle, found.amended)):
        env = FanTrackingEnv(
            SCENARIO, vehicle=model, effects=[request.effect], truth=request.vehicle
        )
        flown.append(_fly(env, seeds, lambda share, i=i: report((i + share) / 2)))  # type: ignore[misc]
    before, after = ([e.rmse for e in some] for some in flown)
    picture = request.out / "before_after.png"
    _draw(flown[0][0], flown[1][0], picture)
    better = sum(a < b for a, b in zip(after, before, strict=True))
    count = len(seeds)
    return Step(
        "Fly better",
        (
            f"The same {count} episodes, with the declared model and with the amended one. Fan, "
            f"gusts and noise are the same.",
            f"Distance from the jet's axis, mean RMSE: {np.mean(before):.3f} m before, "
            f"{np.mean(after):.3f} m after; smaller on {better} of {count}.",
            "So few flights show the way and not a rate: docs/trust.md has twenty for each "
            "of ten effects.",
        ),
        f"windwrench fly --scenario {SCENARIO} --seed {request.seed} --vehicle "
        f"{request.out / 'diagnose' / 'vehicle.yaml'} --truth {shlex.quote(request.vehicle_name)} "
        f"--effect {request.effect_words}",
        picture,
    )


def compare(request: Request, rows: Sequence[Standing], folder: Path) -> Step:
    """Return the step that a leaderboard is, whose files lie in a folder."""
    best = ", ".join(f"{r.controller} {r.rmse_m:.3f} m" for r in rows if r.scenario == SCENARIO)
    return Step(
        "Compare controllers",
        (
            f"{len(LAWS)} controllers fly the same {request.episodes} episodes of each scenario. "
            "Score 0 is a vehicle that hovers, 1 one that sees the fan.",
            f"RMSE on {SCENARIO}: {best}.",
        ),
        f"windwrench benchmark --controllers {','.join(LAWS)} --episodes {request.episodes} "
        f"--seed {request.seed} --out {folder}",
        folder / "leaderboard.png",
        board=rows,
    )


@styled()
def _draw(before: Episode, after: Episode, path: Path) -> None:
    figure = new_figure(4.0)
    axes: Any = figure.subplots()
    longest = max((before, after), key=lambda e: len(e.time))
    fan: NDArray[np.float64] = longest.fan_y
    axes.fill_between(longest.time, fan - 0.45, fan + 0.45, color=JET, label="width of the fan")
    axes.plot(longest.time, fan, "--", color=BLACK, lw=1.5, label="fan")
    axes.plot(before.time, before.y, color=BEFORE, lw=2, label="vehicle, declared model")
    axes.plot(after.time, after.y, color=AFTER, lw=2, label="vehicle, amended model")
    axes.set_title(f"RMSE {before.rmse:.3f} m before, {after.rmse:.3f} m after")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("y (m)")
    room_above(axes)
    axes.legend(loc="upper left", ncols=2)
    write_png(figure, path)
