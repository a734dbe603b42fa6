"""Readers of flight logs of other forms. Each states its assumptions, the thrust model above all,
in the log's notes.

A table needs no code: a map in ``identification/logs/maps/``, and its name in ``reading.TABLES``. A
reader of another form is a file in this folder and a line in ``reading.READERS``. Its function
``read(path, vehicle, piece)`` returns a FlightLog; a reader of tables takes the open table. The
function decodes the file into named columns, each group with its clock; a map in
``maps/recordings/`` states their meaning. The vehicle (or None) turns commands into rotor speeds
where none were measured. ``piece`` is the part to read, from 1, of a file with several logs or with
restarts of the clock; default: the longest.

A reader is chosen by the log's content: the first bytes of a file, or the columns of a table. A
file's name decides nothing but how a table is packed.
"""
