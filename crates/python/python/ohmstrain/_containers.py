"""Containers that other packages read: MATLAB, HDF5, ROS bags and MCAP."""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from . import _core, _tables

#: Largest number of columns of an array; with more it is a picture or a matrix, not readings side by side.
_MOST_COLUMNS = 256
#: Largest distance of stamps from the clock of the file, ns; beyond it they belong to another clock.
_FARTHEST_NS = 10**15


def table(path: str, picked: Iterable[str], part: str | None) -> pa.Table | None:
    """Return the columns of a container, all of one length; None for any other file.

    ``picked`` are requested columns, ``part`` is an HDF5 group or a topic.
    """
    reader = _reader(path)
    if reader is None:
        return _arrow(path)
    try:
        arrays = reader(path, part)
    except (_core.OhmstrainError, OSError) as error:
        # h5py raises an OSError for a file of another kind.
        if isinstance(error, FileNotFoundError) or isinstance(error, _core.OhmstrainError):
            raise
        raise _error(f"cannot be read: {error}") from error
    except Exception as error:  # Each package has exceptions of its own.
        raise _error(f"cannot be read: {type(error).__name__}: {error}") from error
    if not arrays:
        found = f" below `{part}`" if part else ""
        raise _error(
            f"expected arrays of numbers{found}, found none; of a MATLAB table save "
            "table2struct(T, 'ToScalar', true), of a timeseries its Time and Data"
        )
    names = [name for name in picked if name in arrays]
    lengths = {name: len(arrays[name]) for name in names or arrays}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"`{name}` ({length})" for name, length in list(lengths.items())[:12])
        if names:
            raise _error(f"expected columns of one length, found {shown}")
        raise _error(f'arrays of several lengths: {shown}; say which belong together: columns={{"time": NAME, "resistance": NAME}}')
    length = next(iter(lengths.values()))
    return pa.table({name: array for name, array in arrays.items() if len(array) == length})


def _arrow(path: str) -> pa.Table | None:
    """Read Feather, and Parquet with times that the importer would misread."""
    if os.path.isdir(path):
        return None
    with open(path, "rb") as file:
        head = file.read(6)
    if head == b"ARROW1":
        from pyarrow import feather

        return _plain_times(feather.read_table(path))
    if head[:4] != b"PAR1":
        return None
    from pyarrow import parquet

    schema = parquet.read_schema(path)
    odd = [field for field in schema if _is_odd(field)]
    return _plain_times(parquet.read_table(path)) if odd else None


def _is_odd(field: pa.Field) -> bool:
    """True for a duration, or a timestamp with the name of a numeric column."""
    return pa.types.is_duration(field.type) or (pa.types.is_timestamp(field.type) and field.name in _tables.TIMES)


def _plain_times(table: pa.Table) -> pa.Table:
    """Convert durations to seconds, and rename timestamps to names without a unit."""
    for place, field in enumerate(table.schema):
        if pa.types.is_duration(field.type):
            seconds = pa.array(_tables.seconds(table.column(place), field, _tables.Origin(0)))
            table = table.set_column(place, "time_s" if field.name in _tables.TIMES else f"{field.name} (s)", seconds)
        elif _is_odd(field):
            table = table.rename_columns([f"{name[:4]}stamp" if name == field.name else name for name in table.column_names])
    return table


def _reader(path: str) -> Callable[[str, str | None], dict[str, np.ndarray]] | None:
    if os.path.isdir(path):
        return _rosbag if (Path(path) / "metadata.yaml").is_file() else None
    with open(path, "rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB 5.0"):
        return _mat
    if head.startswith((b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")) or head[512:] == b"\x89HDF\r\n\x1a\n":
        return _hdf5
    if head.startswith(b"#ROSBAG V"):
        return _rosbag
    if head.startswith(b"\x89MCAP0\r\n"):
        return _mcap
    if head.startswith(b"SQLite format 3\0") and (Path(path).parent / "metadata.yaml").is_file():
        return lambda path, part: _rosbag(os.fspath(Path(path).parent), part)
    return None


def _error(text: str) -> _core.OhmstrainError:
    return _core.OhmstrainError(text)


def _needed(module: str, package: str, what: str) -> Any:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise _error(f"{what} is read by the package {package}, which is not installed: pip install {package}") from error


def _arrays(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the columns of numbers in an array, or in a struct of arrays."""
    value = np.asarray(value)
    if value.dtype.names:
        fields = value.reshape(-1)
        for field in value.dtype.names:
            yield from _arrays(f"{name}.{field}", fields[field][0] if fields.dtype[field] == object and fields.size == 1 else fields[field])
        return
    if value.dtype == object and value.size == 1:
        yield from _arrays(name, value.item())
        return
    if value.dtype.kind not in "biufM":
        return
    # Arrow supports neither the other byte order nor all of numpy's numbers.
    plain = {"?": "i1", "e": "f4", "g": "f8"}.get(value.dtype.char, value.dtype.newbyteorder("="))
    value = np.squeeze(value.astype(plain, copy=False))
    if value.ndim == 1 and len(value) > 1:
        yield name, np.ascontiguousarray(value)
    elif value.ndim == 2:
        rows = value if value.shape[0] >= value.shape[1] else value.T
        if rows.shape[1] <= _MOST_COLUMNS:
            yield from ((f"{name}[{column + 1}]", np.ascontiguousarray(rows[:, column])) for column in range(rows.shape[1]))


def _below(part: str | None, name: str, separator: str) -> str | None:
    """Return a name relative to the requested part; None if it is not below it."""
    if part is None:
        return name
    inner = part.strip(separator) + separator
    return name[len(inner) :] if name.startswith(inner) else None


def _mat(path: str, part: str | None) -> dict[str, np.ndarray]:
    loaded = _needed("scipy.io", "scipy", "a MATLAB file").loadmat(path)
    columns = (pair for name, value in loaded.items() if not name.startswith("__") for pair in _arrays(name, value))
    return {short: column for name, column in columns if (short := _below(part, name, ".")) is not None}


def _hdf5(path: str, part: str | None) -> dict[str, np.ndarray]:
    h5py = _needed("h5py", "h5py", "HDF5, and so MATLAB 7.3,")
    columns: dict[str, np.ndarray] = {}

    def take(name: str, item: Any) -> None:
        kind = item.attrs.get("MATLAB_class", b"double")
        if not isinstance(item, h5py.Dataset) or name.startswith("#") or kind in (b"char", b"cell", b"table"):
            return
        if item.dtype.names or item.dtype.kind in "biuf":
            short = _below(part, name, "/")
            if short is not None:
                columns.update(_arrays(short, item[()]))

    with h5py.File(path) as file:
        file.visititems(take)
    return columns


class _Topic:
    """Messages of a topic as columns."""

    def __init__(self) -> None:
        self.logged: list[int] = []
        self.stamps: list[int | None] = []
        self.cells: dict[str, list[float]] = {}

    def take(self, logged_ns: int, message: Any) -> None:
        self.logged.append(logged_ns)
        stamp_ns = 0
        for name, value in _fields("", message):
            if name.startswith("header.stamp."):
                stamp_ns += int(value) * (1 if "n" in name[13:] else 10**9)  # sec or secs; nanosec, nsec or nsecs
            elif not name.startswith("header."):
                column = self.cells.setdefault(name, [])
                # Values absent from earlier messages are missing.
                column.extend([np.nan] * (len(self.logged) - 1 - len(column)))
                column.append(value)
        self.stamps.append(stamp_ns or None)

    def columns(self, topic: str, start_ns: int) -> dict[str, np.ndarray]:
        rows = len(self.logged)
        times = self.logged if None in self.stamps else self.stamps
        zero = start_ns if abs(times[0] - start_ns) < _FARTHEST_NS else times[0]
        short = topic.rsplit("/", 1)[-1]
        # A message with a single number gets the name of its topic.
        named = {short + name[4:] if name == "data" or name.startswith("data[") else name: cells for name, cells in self.cells.items()}
        full = {name: np.array(cells + [np.nan] * (rows - len(cells))) for name, cells in named.items()}
        return {"time_s": np.array([time - zero for time in times]) / 1e9, **full}


def _fields(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers in a message by dotted names; elements of arrays are counted from 1."""
    if isinstance(value, (bool, int, float, np.number)):
        yield name, value
    elif isinstance(value, (list, tuple, np.ndarray)):
        for place, item in enumerate(value[:_MOST_COLUMNS]):
            yield from _fields(f"{name}[{place + 1}]", item)
    elif isinstance(value, Mapping):
        for field, item in value.items():
            yield from _fields(f"{name}.{field}".strip("."), item)
    elif not isinstance(value, (str, bytes)) and value is not None:
        names = getattr(value, "__slots__", None) or list(getattr(value, "__dict__", {}))
        for field in names:
            if not field.startswith("_"):
                yield from _fields(f"{name}.{field}".strip("."), getattr(value, field))


def _one_topic(topics: dict[str, _Topic], start_ns: int, part: str | None, names: Iterator[str] | list[str]) -> dict[str, np.ndarray]:
    found = {name: topic for name, topic in topics.items() if topic.cells}
    if len(found) == 1:
        ((name, topic),) = found.items()
        return topic.columns(name, start_ns)
    listed = ", ".join(f"`{name}`" for name in (found or names))
    what = f"no numbers in the topic `{part}`" if part else "several topics with numbers" if found else "no topic with numbers"
    raise _error(f"{what}: say sheet=TOPIC, one of {listed}" if listed else what)


def _rosbag(path: str, part: str | None) -> dict[str, np.ndarray]:
    highlevel = _needed("rosbags.highlevel", "rosbags", "a ROS bag")
    typesys = importlib.import_module("rosbags.typesys")
    topics: dict[str, _Topic] = {}
    with highlevel.AnyReader([Path(path)], default_typestore=typesys.get_typestore(typesys.Stores.LATEST)) as reader:
        wanted = [connection for connection in reader.connections if part in (None, connection.topic)]
        names = [connection.topic for connection in reader.connections]
        for connection, logged_ns, data in reader.messages(connections=wanted) if wanted else ():
            topics.setdefault(connection.topic, _Topic()).take(logged_ns, reader.deserialize(data, connection.msgtype))
        return _one_topic(topics, reader.start_time, part, names)


def _mcap(path: str, part: str | None) -> dict[str, np.ndarray]:
    make_reader = _needed("mcap.reader", "mcap", "MCAP").make_reader
    topics: dict[str, _Topic] = {}
    decoders: dict[int, Callable[[bytes], Any]] = {}
    with open(path, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        start_ns = summary.statistics.message_start_time if summary and summary.statistics else None
        names = [channel.topic for channel in summary.channels.values()] if summary else []
        for schema, channel, message in reader.iter_messages(topics=None if part is None else [part]):
            if channel.id not in decoders:
                decoders[channel.id] = _decoder(channel.message_encoding, schema)
            start_ns = message.log_time if start_ns is None else start_ns
            topics.setdefault(channel.topic, _Topic()).take(message.log_time, decoders[channel.id](message.data))
    return _one_topic(topics, start_ns or 0, part, names)


def _decoder(encoding: str, schema: Any) -> Callable[[bytes], Any]:
    if encoding == "json":
        return json.loads
    if encoding == "cdr":
        factory = _needed("mcap_ros2.decoder", "mcap-ros2-support", "MCAP of ROS 2").DecoderFactory()
        decoder = factory.decoder_for(encoding, schema)
        if decoder is not None:
            return decoder
    raise _error(f"MCAP with messages in {encoding} is not read: expected cdr (ROS 2) or json")
