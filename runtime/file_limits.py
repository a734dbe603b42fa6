"""The largest cost of a file before its refusal: a few kilobytes may unpack to any size, and a
short text may take any time.

With these limits a refusal takes at most about 1 GB of memory, and 10 s before the rows are read. A
table of 4 million rows with a wrong last one takes 20 s. Valid files may take more. Everything is
counted while it is unpacked; sizes of a Parquet file's columns are taken from its footer.
"""

from dataclasses import dataclass

from .errors import InputError


@dataclass(frozen=True)
class FileLimits:
    """Limits of files that are read. Sizes are in bytes unpacked unless something else is said.

    Attributes:
        table_text: characters of a CSV file, or bytes of a Parquet file and of each of its
            columns. A flight of three hours at 200 Hz with 20 columns has 7.5e8 characters.
        table_line: characters of one of its lines.
        table_rows: rows of a table or messages of a topic: more than an hour at 1 kHz.
        table_numbers: rows times columns; each number takes 8 bytes, and a flight log is copied
            about twice. A flight of three hours has 4.3e7.
        list_numbers: numbers in all columns of lists and structs of a Parquet file, unpacked to
            find their parts.
        arrays: bytes of the arrays in a MATLAB or NumPy file.
        parquet_footer: items of a list, or bytes of a text, in the footer of a Parquet file.
        yaml_text: bytes of a YAML file, the settings of a vehicle or of a training.
        yaml_values: values of a YAML file, with every alias written out.
        yaml_depth: levels of values within values.
        json_text: bytes of a JSON file: the card of a policy, the progress of a training.
        policy_file: bytes of a policy's ``.npz``; policies of the kit have some 100 kB.
        policy_weights: bytes of a policy's arrays.
        checkpoint: bytes of a training's checkpoint, with the replay memory, not packed.
        bag_chunk: bytes of a chunk of a ROS bag; recorders make chunks of some megabytes.
        bag_unpacked: bytes of all unpacked chunks of one bag.
        bag_index: entries in the index of a ROS 1 bag; there is one for each message.
        ulog_file: bytes of a PX4 log.
        binary_log: bytes of a log of ArduPilot, Betaflight or a Crazyflie, read whole.
        log_fields: variables in one kind of its records; ArduPilot's have at most 16.
        ulog_fields: fields of all its subscribed topics, nested fields written out; PX4's logs have
            some 10,000.
        ulog_texts: information, parameters, texts and dropouts of a PX4 log; PX4's logs have some
            2,000.
        ulog_damages: unreadable places of a PX4 log; each takes some 0.1 ms.
    """

    table_text: int = 2**30
    table_line: int = 1_000_000
    table_rows: int = 4_000_000
    table_numbers: int = 2**26
    list_numbers: int = 2**25
    arrays: int = 2**29
    parquet_footer: int = 2**20
    yaml_text: int = 200_000
    yaml_values: int = 20_000
    yaml_depth: int = 60
    json_text: int = 2**22
    policy_file: int = 2**24
    policy_weights: int = 2**26
    checkpoint: int = 2**30
    bag_chunk: int = 2**26
    bag_unpacked: int = 2**31
    bag_index: int = 4_000_000
    ulog_file: int = 2**29
    binary_log: int = 2**28
    log_fields: int = 500
    ulog_fields: int = 200_000
    ulog_texts: int = 200_000
    ulog_damages: int = 20_000


LIMITS = FileLimits()


def check_count(where: object, count: int, most: int, what: str) -> None:
    """Raise InputError where a file holds more than ``most`` of something."""
    if count > most:
        raise InputError(f"{where}: more than {most} {what}; expected one flight")
