"""Reading of files."""

from __future__ import annotations

import errno
import json
import os
import re
import shlex
import tempfile
from collections.abc import Iterable, Mapping
from typing import Any

import pyarrow as pa

from . import _containers, _core, _tables
from ._sensor import _warn

#: Arguments that take a value per role, and those that take lists; the importer's messages contain their flags.
_BY_ROLE = {"column": "columns", "unit": "units", "zero": "zero", "where": "where"}
_LISTS = ("magnitude", "drop_zeros", "missing")
#: Placeholders of numbers in messages.
_NUMBERS = ("HZ", "MM", "N", "S", "SECONDS")
_FLAG = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: ((?:'[^']*'|\\'|[^\s'\\])+))?")
_SWITCHES = ("fold-polarity",)
#: Flags that exist on the command line only.
_COMMANDS = {"split-recordings": "`ohmstrain import --split-recordings`"}


def read(
    *paths: str | os.PathLike[str],
    columns: Mapping[str, str | int | None] | None = None,
    units: Mapping[str, str] | None = None,
    decimal: str | Mapping[int, str] | None = None,
    skip: int | Mapping[int, int] | None = None,
    sheet: str | None = None,
    where: Mapping[str, Any] | None = None,
    recording: int | None = None,
    missing: Iterable[str] = (),
    magnitude: Iterable[str] = (),
    drop_zeros: Iterable[str] = (),
    zero: Mapping[str, float] | None = None,
    fold_polarity: bool = False,
    align: str | float | None = None,
    rate_hz: float | None = None,
    preset: str | None = None,
    gauge_length_mm: float | None = None,
    front_end: str | None = None,
    joint: str | None = None,
    strain_unit: str | None = None,
    resistance_unit: str | None = None,
) -> pa.Table:
    """Read a recording from a trace CSV, as ``ohmstrain import`` writes it, or from a lab's files, as ``ohmstrain import`` reads them.

    Parameters
    ----------
    *paths
        Files of one recording: text, XLSX, Parquet, each optionally in gzip. MATLAB files are read by scipy, those of version 7.3 and
        other HDF5 by h5py, ROS 1 and ROS 2 bags by rosbags, MCAP by mcap (that of ROS 2 with mcap-ros2-support). If the package is
        missing, the error names it.
    columns : dict
        Columns by role, by name or number from 1: ``{"time": "Time (s)", "resistance": 3, "angle": None}``; in a second file
        ``"2:Position"``. Roles: time, reference-time, resistance, ratio, adc, strain, displacement, angle, temperature.
    units : dict
        Units by role: ``{"time": "ms", "resistance": "kohm", "strain": "percent"}``; for a reference in volts its scale, ``"4mm/V"``.
    decimal : str or dict
        Decimal mark, or marks by file, counted from 1.
    skip : int or dict
        Number of lines above header and data.
    sheet : str
        Sheet of a workbook, file in a zip archive, group of HDF5, struct of a MATLAB file, or topic of a bag.
    where : dict
        Selects rows by the value of a column: ``{"trial": 2}``.
    recording : int
        Number of the recording, counted from 1, in a file with several. A new one begins where the clock restarts, or where the value
        of a column such as ``trial`` or ``run`` changes.
    missing : list of str
        Texts that represent missing values, besides the usual ones.
    magnitude, drop_zeros : list of str
        Roles whose sign is arbitrary; roles in which a lone 0 is a missing value.
    zero : dict
        Reference at rest by role, in the unit of its column.
    fold_polarity : bool
        Average neighbouring readings that were taken with opposite signs of the current.
    align : str or float
        Clocks of readings and reference: ``motion``, ``none``, or the seconds to add to the reference's.
    rate_hz : float
        Rows per second, if no column is a time.
    preset : str
        A known layout: ``electromech-stretcher``.
    gauge_length_mm, front_end, joint
        Lines above the header of a trace CSV.
    strain_unit, resistance_unit : str
        ``fraction`` or ``percent``; ``ohm`` or ``kohm``.

    Returns
    -------
    pyarrow.Table
        Columns ``time_s``; ``resistance_ohm``, ``resistance_ratio`` or ``adc``; and, if the files have them, ``strain`` or ``angle_deg``
        and ``temperature_c``. Its metadata contain name, front end, joint and units, which ``calibrate``, ``filter`` and ``smooth`` then
        use. ``.to_pandas()`` drops the metadata.

    Raises
    ------
    OhmstrainError
        Names the argument that answers an open question about a file.
    """
    if not paths:
        raise TypeError("expected at least one path")
    arguments = {
        "preset": preset,
        "columns": [(role, "none" if column is None else str(column)) for role, column in (columns or {}).items()],
        "units": [(role, str(unit)) for role, unit in (units or {}).items()],
        "decimal": _per_file(decimal),
        "skip": _per_file(skip),
        "sheet": sheet,
        "rows": [f"{column}={value}" for column, value in (where or {}).items()],
        "recording": recording,
        "missing": _texts(missing),
        "magnitude": _texts(magnitude),
        "drop_zeros": _texts(drop_zeros),
        "zero": list((zero or {}).items()),
        "fold_polarity": fold_polarity,
        "align": None if align is None else str(align),
        "rate_hz": rate_hz,
        "gauge_length_mm": gauge_length_mm,
        "front_end": front_end,
        "joint": joint,
        "strain_unit": strain_unit,
        "resistance_unit": resistance_unit,
    }
    names = [os.fspath(path) for path in paths]
    with tempfile.TemporaryDirectory(prefix="ohmstrain-") as folder:
        readable = [_readable(name, place, folder, sheet, columns) for place, name in enumerate(names)]
        if readable != names:
            # Containers have taken it.
            arguments["sheet"] = None

        def in_names(text: str) -> str:
            for given, read_from in zip(names, readable):
                text = text.replace(read_from, given)
            return text

        try:
            batch, remarks = _core.read(readable, arguments)
        except _core.OhmstrainError as error:
            named = _core.OhmstrainError(as_arguments(in_names(str(error))))
            named.file, named.row, named.column = ", ".join(names), error.row, error.column
            raise named from None
    _warn(as_arguments(in_names(remark)) for remark in remarks)
    table = _tables.from_core(batch)
    metadata = {key: in_names(value.decode()).encode() for key, value in (table.schema.metadata or {}).items()}
    return table.replace_schema_metadata(metadata) if readable != names else table


def _readable(name: str, place: int, folder: str, sheet: str | None, columns: Mapping[str, Any] | None) -> str:
    """Return the file itself; for a container, a Parquet file with its columns."""
    try:
        found = _containers.table(name, _of_file(columns, place), sheet)
    except _core.OhmstrainError as error:
        named = _core.OhmstrainError(f"{name}: {error}")
        named.file = name
        raise named from error.__cause__
    if found is None:
        if os.path.isdir(name):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), name)
        return name
    from pyarrow import parquet

    path = os.path.join(folder, f"{place}.parquet")
    parquet.write_table(found, path)
    return path


def _of_file(columns: Mapping[str, Any] | None, place: int) -> list[str]:
    """Return the columns that are requested of a file or of any: without the number of the file."""
    named = (str(column) for column in (columns or {}).values() if column is not None)
    return [column.removeprefix(f"{place + 1}:") for column in named]


def _texts(given: str | Iterable[str]) -> list[str]:
    return [given] if isinstance(given, str) else [str(text) for text in given]


def _per_file(given: Any) -> list[str]:
    if given is None:
        return []
    return [f"{file}:{value}" for file, value in given.items()] if isinstance(given, Mapping) else [str(given)]


def as_arguments(message: str) -> str:
    """Replace the flags in a message of the importer by arguments: ``units={"strain": "percent"}``."""
    out, last = [], 0
    flags = list(_FLAG.finditer(message))
    while flags:
        flag = flags.pop(0)
        out.append(message[last : flag.start()])
        text, rest = _argument(flag)
        # Adjacent flags that form one argument.
        together = [text]
        while flags and not rest and message[flag.end() : flags[0].start()] == " " and flags[0][1] == flag[1] in _BY_ROLE:
            flag = flags.pop(0)
            text, rest = _argument(flag)
            together.append(text)
        out.append(_merged(together) + rest)
        last = flag.end()
    return "".join([*out, message[last:]])


def _merged(arguments: list[str]) -> str:
    first, *others = arguments
    return first if not others else ", ".join([first[:-1], *(other.split("=", 1)[1][1:-1] for other in others)]) + "}"


def _argument(flag: re.Match[str]) -> tuple[str, str]:
    """Return a flag as an argument, and the text after its value."""
    name, word = flag[1], flag[2]
    key = name.replace("-", "_")
    if name in _COMMANDS:
        return _COMMANDS[name], "" if word is None else f" {word}"
    if word is None:
        return (f"{key}=True", "") if name in _SWITCHES else (key, "")
    if name in _SWITCHES:
        return f"{key}=True", f" {word}"
    # Punctuation after an unquoted word belongs to the sentence.
    bare = word if name == "decimal" else word.rstrip(":;,") or word
    value, rest = "".join(shlex.split(bare)), word[len(bare) :]
    role, is_pair, of_role = value.partition("=")
    if name in _BY_ROLE and is_pair:
        return f"{_BY_ROLE[name]}={{{json.dumps(role)}: {_value(key, of_role)}}}", rest
    file, is_of_file, of_file = value.partition(":")
    if name in ("decimal", "skip") and is_of_file and file.isdigit():
        return f"{key}={{{file}: {_value(key, of_file)}}}", rest
    shown = _value(key, value)
    return f"{key}=[{shown}]" if key in _LISTS else f"{key}={shown}", rest


def _value(key: str, text: str) -> str:
    if key == "column" and text == "none":
        return "None"
    is_number = text in _NUMBERS or (key not in ("unit", "missing") and re.fullmatch(r"-?\d+(\.\d+)?", text))
    return text if is_number else json.dumps(text, ensure_ascii=False)
