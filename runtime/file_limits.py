"""What a file may cost before it is refused: a few kilobytes may unpack to any size, and a short
text may take any time.

With these limits no file takes more than about 1 GB of memory before it is refused, and none more
than 10 s before its rows are read: a table of 4 million rows whose last one is wrong takes 20 s.
Files that pass take more. Everything is counted while it is unpacked; of a Parquet file's columns
the sizes are believed that its footer states.
"""

from dataclasses import dataclass

from .errors import InputError


@dataclass(frozen=True)
class FileLimits:
    """Limits of what is read from files. Sizes are in bytes unpacked unless something else is said.

    Attributes:
        table_text: characters of a CSV file, or bytes of a Parquet file and of each of its
            columns. A flight of three hours at 200 Hz with 20 columns has 7.5e8 characters.
        table_line: characters of one of its lines.
        table_rows: rows of a table or messages of a topic: more than an hour at 1 kHz.
        table_numbers: rows times columns that are read; each number takes 8 bytes, and a flight
            log is copied about twice. That flight has 4.3e7.
        list_numbers: of all columns of lists and structs in a Parquet file, which are unpacked to
            find their parts.
        arrays: bytes of the arrays in a MATLAB or NumPy file.
        parquet_footer: items of a list, or bytes of a text, in what describes a Parquet file.
        yaml_text: bytes of a YAML file, the settings of a vehicle or of a training.
        yaml_values: values in it, with every alias written out.
        yaml_depth: of values within values.
        json_text: bytes of a JSON file: the card of a policy, the progress of a training.
        policy_file: bytes of a policy's ``.npz``; those of the kit have some 100 kB.
        policy_weights: of its arrays.
        checkpoint: bytes of a training's checkpoint, which holds the replay memory, not packed.
        bag_chunk: of a chunk of a ROS bag; recorders make chunks of some megabytes.
        bag_unpacked: of all chunks that are unpacked to read one bag.
        bag_index: entries in the index of a ROS 1 bag; there is one for each message.
        ulog_file: bytes of a PX4 log.
        binary_log: bytes of a log that is read whole, of ArduPilot, Betaflight or a Crazyflie.
        log_fields: variables in one kind of its records; ArduPilot's have at most 16.
        ulog_fields: fields of all topics that it subscribes to, those within fields written out;
            PX4's logs have some 10,000.
        ulog_texts: information, parameters, texts and dropouts in it; PX4's logs have some 2,000.
        ulog_damages: places in it where no message can be read; each takes some 0.1 ms.
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
