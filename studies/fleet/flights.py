"""The flights: individuals of three vehicles, of which some change from flight to flight, and some
spoiled logs among them.
"""

import gzip
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.dynamics.effects import get
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog, write_log
from windwrench.runtime.errors import InputError

MODELS = ("ardrone2", "crazyflie", "hummingbird")
KINDS = ("steady", "draggy", "wearing", "shifting")
SECONDS = 15.0  # of each flight
TRAJECTORY = "excite"
EACH = 20  # flights of an individual; twelve individuals take turns, then come twelve more
SPOILED = 20  # one log of so many is spoiled
_ATTEMPTS = 4  # draws of a flight that the flight loop may be unable to fly
# what drifts: effect, coefficient, and its size at the first and the last flight in typical sizes
DRIFTS = {
    "wearing": ("rotor_efficiency", "e1", 0.25, 1.25),
    "shifting": ("com_offset", "cx", 0.5, 1.5),
}


@dataclass(frozen=True)
class Flight:
    """One flight of the study."""

    model: str
    kind: str
    group: int  # of twelve individuals
    number: int  # of the individual's flights, from 0
    place: int  # among all flights

    @property
    def id(self) -> str:
        """The individual."""
        return f"{self.model}-{self.kind}-{self.group + 1}"

    def path(self, folder: Path) -> Path:
        """Return where its log lies."""
        return folder / self.id / f"flight{self.number + 1}.csv.gz"


def flights(count: int) -> list[Flight]:
    """Return so many flights, the first ones of those of a larger count."""
    individuals = [(model, kind) for model in MODELS for kind in KINDS]
    found = []
    for place in range(count):
        round_, which = divmod(place, len(individuals))
        found.append(Flight(*individuals[which], *divmod(round_, EACH), place))
    return found


def effects_of(flight: Flight) -> tuple[EffectSetting, ...]:
    """Return what acts on a flight and its declared vehicle lacks."""
    column = 1 if load_vehicle(flight.model).mass < 0.1 else 0
    found = []
    if flight.kind == "draggy":
        sizes = {c.name: c.typical[column] for c in get("rotor_drag").coefficients}
        found.append(EffectSetting("rotor_drag", sizes))
    if flight.kind in DRIFTS:
        name, coefficient, first, last = DRIFTS[flight.kind]
        size = first + (last - first) * flight.number / (EACH - 1)
        sizes = {
            c.name: size * c.typical[column] if c.name == coefficient else 0.0
            for c in get(name).coefficients
        }
        found.append(EffectSetting(name, sizes))
    return tuple(found)


def record(flight: Flight, folder: Path) -> None:
    """Fly a flight and write its log, spoiled where it is its turn; one that is there stays.

    Raises:
        InputError: the flight crashes again and again, or the log cannot be written.
    """
    path = flight.path(folder)
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    vehicle = load_vehicle(flight.model)
    for attempt in range(_ATTEMPTS):
        try:
            flown = record_flight(
                vehicle,
                effects_of(flight),
                TRAJECTORY,
                SECONDS,
                _ATTEMPTS * flight.place + attempt,
            )
            break
        except InputError:
            if attempt + 1 == _ATTEMPTS:
                raise
    log = FlightLog(
        flown["t"],
        flown["position"],
        flown["quaternion"],
        flown["rotor_speeds"],
        flown.get("voltage"),
        name=path.stem,
        vehicle=flight.model,
    )
    write_log(log, path)
    if flight.place % SPOILED == SPOILED // 2:
        spoil = _SPOILS[flight.place // SPOILED % len(_SPOILS)]
        path.write_bytes(spoil(path.read_bytes()))


def _cut(data: bytes) -> bytes:
    """Return the first half of a packed file, as a full disk leaves it."""
    return data[: len(data) // 2]


def _short(data: bytes) -> bytes:
    """Return the first second."""
    return gzip.compress(b"".join(gzip.decompress(data).splitlines(True)[:200]), mtime=0)


def _gap(data: bytes) -> bytes:
    """Return the log with a rotor speed that is no number."""
    lines = gzip.decompress(data).splitlines(True)
    names = lines[0].strip().split(b",")
    fields = lines[len(lines) // 2].split(b",")
    fields[names.index(b"omega2")] = b"nan"
    lines[len(lines) // 2] = b",".join(fields)
    return gzip.compress(b"".join(lines), mtime=0)


def _rpm(data: bytes) -> bytes:
    """Return the log with a whole column missing."""
    text = gzip.decompress(data).replace(b"omega3", b"rotor3", 1)
    return gzip.compress(text, mtime=0)


_SPOILS: tuple[Callable[[bytes], bytes], ...] = (_cut, _short, _gap, _rpm)


def drifting(kind: str) -> tuple[str, str] | None:
    """Return the effect and the coefficient that drift on individuals of a kind, or None."""
    return DRIFTS[kind][:2] if kind in DRIFTS else None


def true_change(model: str, kind: str) -> float:
    """Return the true change a flight of what drifts, 0 where nothing does."""
    if kind not in DRIFTS:
        return 0.0
    name, coefficient, first, last = DRIFTS[kind]
    column = 1 if load_vehicle(model).mass < 0.1 else 0
    sizes = {c.name: c.typical[column] for c in get(name).coefficients}
    return sizes[coefficient] * (last - first) / (EACH - 1)
