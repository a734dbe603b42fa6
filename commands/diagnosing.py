"""The effects that a vehicle's model lacks, found from flight logs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.errors import InputError
from .flight_logs import AS_THEY_ARE, LogOptions, log_notes, read_flights, read_logs
from .terminal import command_line, console, results_folder, say, show_page, show_table, working

if TYPE_CHECKING:
    from ..identification.findings import Diagnosis
    from ..identification.logs.example import Example
    from ..identification.logs.flight_log import FlightLog

# share of a diagnosis' time at which its stages begin
_STAGES = {"looking at the logs": 0.0, "predicting the flights": 0.96}


def staged(progress: Callable[..., None]) -> Callable[[str], None]:
    """Return a function of the stages of a diagnosis that tells their progress."""
    return lambda text: progress(_STAGES.get(text), text)


def diagnose(
    logs: list[Path] | None = None,
    example: bool = False,
    no_open: bool = False,
    test: list[Path] | None = None,
    reading: LogOptions = AS_THEY_ARE,
    rotor_faults: bool = False,
    without: list[str] | None = None,
    out: Path = Path("results/diagnose"),
) -> dict[str, Any]:
    """Name effects that a vehicle's model lacks, from flight logs. Write report.json, report.html
    and vehicle.yaml.

    Example: windwrench diagnose flight.csv --vehicle my_drone.yaml --out results/my_drone
    """
    if example:
        from ..identification.logs.example import example_flight

        given = {"LOGS": logs, **{f"--{name}": x for name, x in vars(reading).items()}}
        given |= {"--test": test, "--rotor-faults": rotor_faults}
        if unwanted := [name for name, value in given.items() if value]:
            raise InputError(f"--example: has a log of its own and takes no {unwanted[0]}")
        with example_flight() as flight:
            console.print(f"{flight.what} ({flight.source})\nKnown before the diagnosis:")
            for why in (*(known.why for known in flight.known), flight.unknown):
                console.print(f"  * {why}")
            read = read_flights([flight.log], LogOptions(vehicle=flight.vehicle))
            result = _diagnose(read, [flight.log], without, out)
        result["known"] = confronted(flight, result["effects"])
        show_page(out / "report.html", not no_open)
        return result
    if not logs:
        raise InputError("diagnose: expected at least one flight log, or --example")
    if rotor_faults:
        if test or reading.piece:
            option = "--test" if test else "--piece"
            raise InputError(f"--rotor-faults: takes no {option}")
        return _rotor_faults(logs, reading, out)
    read = read_flights([*logs, *(test or [])], reading)
    return _diagnose(read, logs, without, out)


def confronted(example: "Example", effects: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Print the known effects found, by name or as one not told apart, and the others named; return
    the former. Effects are as ``report.json`` names them.
    """
    rows, others = [], [str(effect["name"]) for effect in effects]
    for known in example.known:
        named = [
            str(effect["name"])
            for effect in effects
            if {effect["name"], *effect["indistinguishable_from"]} & set(known.effects)
        ]
        found = f"found as {' and '.join(named)}" if named else "not found"
        console.print(f"Known: {' or '.join(known.effects)}, {found}.")
        rows.append({"known": known.why, "effects": list(known.effects), "named": named})
        others = [name for name in others if name not in named]
    if others:
        console.print(f"Named without a known answer: {', '.join(others)}.")
    return rows


def _diagnose(
    read: "tuple[list[FlightLog], Any]",
    paths: Sequence[Path],
    without: Sequence[str] | None,
    out: Path,
) -> dict[str, Any]:
    """Find the effects that a vehicle's model lacks; write the report.

    Args:
        read: flights and their vehicle; flights after the paths' own are test flights.
        paths: paths of the logs for the fit.
        without: effects left out of the library.
        out: folder for the report.
    """
    from ..identification.diagnosis import diagnose as run
    from ..identification.report.files import report_data, write_report
    from ..identification.report.headline import headline
    from ..identification.report.words import doubts, remainder_sentence

    (every, model), count = read, len(paths)
    folder = results_folder(out)
    with working("looking at the logs") as progress:
        diagnosis = run(every[:count], model, every[count:], without or (), staged(progress))
    diagnosis = _with_rotor_faults(diagnosis, paths, every[:count])
    # before a word is said: a reader who has read enough (a pipe to head) must not cost the results
    written = write_report(diagnosis, folder, command_line())
    log_notes(doubted := doubts(diagnosis))
    faults = [data["headline"] for data in diagnosis.rotor_faults if data["rotor"] is not None]
    sentences = (headline(diagnosis), remainder_sentence(diagnosis), *faults)
    for sentence in (*sentences, f"vehicle: {model.name}"):
        console.print(sentence)
    _show(diagnosis)
    for line in diagnosis.advice:
        console.print(line)
    log_notes(text for text in diagnosis.notes if text not in doubted)
    say(*written)
    return report_data(diagnosis)


def _show(diagnosis: "Diagnosis") -> None:
    """Print the tables of effects and of the error before and after."""
    from ..identification.report.amounts import amount
    from ..identification.report.words import by_energy, chance, error_table

    stated = diagnosis.probabilities.names
    rows: list[tuple[str, ...]] = []
    for effect in by_energy(diagnosis):
        name = " or ".join((effect.name, *effect.indistinguishable_from))
        head = [f"{name} (tentative)" if effect.tentative else name]
        head += [chance(stated[effect.name])] if stated else []
        for name in effect.coefficients:
            acts = amount(effect, name, diagnosis.declared)
            rows.append((head[0], name, f"{acts} {acts.when}".rstrip(), *head[1:]))
            head = [""] * len(head)
    if rows:
        last = ("probability",) if stated else ()
        show_table(("effect", "", "amount", *last), rows)
    rows = []
    for row in error_table(diagnosis):
        unit = f" ({row['unit']})" if row["unit"] else ""
        rows.append((f"{row['what']}{unit}", row["before"], row["after"], row["floor"]))
    show_table(("error on held-out data", "before", "after", "noise floor"), rows)


def _with_rotor_faults(
    diagnosis: "Diagnosis", paths: Sequence[Path], flights: "Sequence[FlightLog]"
) -> "Diagnosis":
    """Add losses of a rotor's thrust during a flight, for logs fit to show one."""
    from ..identification.comparison.fault_channels import samples_of
    from ..identification.comparison.fault_detection import find_fault
    from ..identification.comparison.words import fault_data

    faults = []
    with working("looking for a rotor that lost thrust"):
        for path, log in zip(paths, flights, strict=True):
            try:
                faults.append(fault_data(find_fault(samples_of(log, path))))
            except InputError:
                continue  # no gyro, no accelerometer, no command, or too little flight
    notes = tuple(data["headline"] for data in faults if data["rotor"] is not None)
    return replace(diagnosis, rotor_faults=tuple(faults), notes=(*diagnosis.notes, *notes))


def _rotor_faults(logs: Sequence[Path], reading: LogOptions, out: Path) -> dict[str, Any]:
    """Look for rotors that lost thrust during flights; write rotor_faults.json and a picture."""
    from ..dynamics.vehicle_file import load_vehicle
    from ..identification.comparison.fault_channels import samples_of
    from ..identification.comparison.fault_detection import find_fault
    from ..identification.comparison.words import fault_data, write_faults

    model = None if reading.vehicle is None else load_vehicle(reading.vehicle)
    flights = read_logs(logs, reading, model)
    folder = results_folder(out)
    faults = []
    with working("looking for a rotor that lost thrust") as progress:
        for i, (path, log) in enumerate(zip(logs, flights, strict=True)):
            progress(i / len(logs))
            faults.append(find_fault(samples_of(log, path)))
    written = write_faults(faults, folder)
    log_notes(text for log in flights for text in log.notes)
    result = [fault_data(fault) for fault in faults]
    for data in result:
        ended = f"; nothing later: {data['ended_because']}" if data["ended_because"] else ""
        console.print(f"{data['log']}: {data['flight_s']:.1f} s in flight{ended}")
        console.print(data["headline"])
    say(*written)
    return {"rotor_faults": result}
