"""A log that was tampered with is refused, noted, or gives the wrench of the clean one."""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from windwrench.dynamics import InputError, load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog, with_rows
from windwrench.identification.logs.stuck_channels import stuck_notes
from windwrench.identification.wrench_series import estimate_log

VEHICLE = load_vehicle("ardrone2")


@cache
def flight():
    return FlightLog(
        **record_flight(VEHICLE, trajectory="excite", seconds=14.0, seed=3), name="flight.csv"
    )


def late(log):
    return log.t > 5.0


def column(name, i, change):
    def tampered(log):
        values = getattr(log, name).copy()
        values[:, i] = change(log, values[:, i])
        return replace(log, **{name: values})

    return tampered


def held(log, values):
    return np.where(late(log), values[np.argmax(late(log))], values)


def held_attitude(log):
    first = log.quaternion[np.argmax(late(log))]
    return replace(log, quaternion=np.where(late(log)[:, None], first, log.quaternion))


def outliers(log):
    some = np.random.default_rng(0).random(len(log.t)) < 0.01
    return replace(log, position=log.position + np.where(some, 0.1, 0.0)[:, None])


TAMPERED = {
    "a second of rows dropped": lambda log: with_rows(log, ~late(log) | (log.t > 6.0)),
    "every other row": lambda log: with_rows(log, np.arange(len(log.t)) % 2 == 0),
    "outliers": outliers,
    "a rotor speed stands still": column("rotor_speeds", 1, held),
    "a rotor speed is zero": column(
        "rotor_speeds", 1, lambda log, values: np.where(late(log), 0.0, values)
    ),
    "a rotor's column twice": lambda log: replace(
        log, rotor_speeds=log.rotor_speeds[:, [0, 0, 2, 3]]
    ),
    "x stands still": column("position", 0, held),
    "the attitude stands still": held_attitude,
    "moved for good": lambda log: replace(
        log, position=log.position + np.where(late(log)[:, None], [3.0, 0.0, 0.0], 0.0)
    ),
}


def wrench_errors(log):
    """Root mean square errors (N, N m) of the last seconds; notes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        series = estimate_log(log, VEHICLE)
    end = log.t > log.t[-1] - 5.0
    return (
        np.sqrt(np.mean(np.square(series.force - log.force)[end])),
        np.sqrt(np.mean(np.square(series.torque - log.torque)[end])),
        series.notes,
    )


def test_rotors_that_are_alike_in_pairs_are_a_flight_in_a_plane():
    log = flight()
    pairs = replace(log, rotor_speeds=log.rotor_speeds[:, [0, 1, 1, 0]])
    assert not [note for note in stuck_notes(pairs, VEHICLE) if "same in every row" in note]
    twice = replace(log, rotor_speeds=log.rotor_speeds[:, [0, 1, 2, 1]])
    (note,) = [note for note in stuck_notes(twice, VEHICLE) if "same in every row" in note]
    assert "omega2 and omega4" in note


@cache
def clean_errors():
    return wrench_errors(flight())


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_log_is_refused_noted_or_answered_as_well_as_the_clean_one(name):
    said = {
        "a rotor speed stands still": "omega2 stands still for 9",
        "x stands still": "px stands still",
        "the attitude stands still": "the attitude stands still",
    }
    force, torque, notes = clean_errors()
    assert not notes
    try:
        spoiled_force, spoiled_torque, notes = wrench_errors(TAMPERED[name](flight()))
    except InputError as error:
        refusal = str(error)
    else:
        refusal = ""
    if refusal:
        assert "flight.csv" in refusal
    else:
        assert said.get(name, "") in " ".join(notes)
        assert notes or (spoiled_force < 1.3 * force and spoiled_torque < 1.3 * torque)


def test_a_clean_flight_and_a_rotor_at_its_limit_are_not_noted():
    log = flight()
    assert stuck_notes(log, VEHICLE) == ()
    limited = replace(VEHICLE, omega_max=float(np.quantile(log.rotor_speeds, 0.3)))
    clipped = np.minimum(log.rotor_speeds, limited.omega_max)
    clipped[:, 0] = limited.omega_max
    assert stuck_notes(replace(log, rotor_speeds=clipped), limited) == ()
