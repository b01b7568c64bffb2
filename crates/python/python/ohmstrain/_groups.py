"""Many recordings in one table: common code for every engine that groups rows and passes each group on as Arrow.

Nothing here schedules, shuffles or stores: an engine calls a :class:`Work` with the rows of one recording.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from . import _core, _tables
from ._sensor import Sensor, _choices, _options, _split

#: Columns that distinguish recordings, that of the sensor first.
BY = ("sensor_id", "recording_id")
#: Column with the error of a recording; null in rows of good recordings.
ERROR = "error"
#: Column with the warnings about a recording, in its first row; null otherwise.
WARNINGS = "warnings"

#: Columns that ``evaluate`` and ``calibrate`` return for each recording or sensor, beside its keys.
SCORES = ("n", "filter_percent_fs", "smoother_percent_fs", "static_cubic_percent_fs", "coverage_95")


class Work:
    """Task for the rows of one group. It can be sent to other processes, with sensors as text."""

    def __init__(self, task: str, by: Iterable[str], sensors: Any = None, **arguments: Any) -> None:
        self.task = task
        self.by = [by] if isinstance(by, str) else list(by)
        if not self.by:
            raise _core.OhmstrainError("by: expected the columns that tell recordings apart, found none")
        self.about, self.options = _split(arguments)
        self.texts = None if task == "calibrate" else _texts(sensors)
        self._made: dict[Any, Sensor] = {}
        # Invalid options raise an error here, instead of one in each of ten thousand groups.
        if task == "calibrate":
            _core.check_choices(_choices(**self.options))
        else:
            given = [Sensor.from_toml(text) for text in self.texts.values()]
            columns = [sensor._core.columns(self.about, _options(**self.options)) for sensor in given]
            if any(names != columns[0] for names in columns):
                raise _core.OhmstrainError("sensors: expected sensors of one quantity and one unit of readings")
            self.columns, self.reading = columns[0], given[0].reading
            given[0]._core.live(_options(**self.options), self.about)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_made": {}}

    def check(self, kinds: Mapping[str, Any]) -> None:
        """Refuse a table that lacks needed columns, or has them in other types, before the job starts.

        Types are Arrow's, or Python's ``object`` if an engine has no such type; None is not checked.
        """
        names = list(kinds)
        for key in self.by:
            if key not in names:
                raise _core.OhmstrainError(f"by: expected the column `{key}`, found `{','.join(names)}`")
        for group in (("time_s", "time_us"), ("resistance_ohm", "resistance_ratio", "adc")):
            if not any(name in names for name in group):
                raise _core.OhmstrainError(f"expected a column `{'` or `'.join(group)}`, found `{','.join(names)}`")
        if self.task in ("calibrate", "evaluate") and not any(
            name in names for name in ("strain", "displacement_mm", "angle_deg")
        ):
            raise _core.OhmstrainError(f"expected a reference (strain, displacement_mm or angle_deg), found `{','.join(names)}`")
        for name, kind in kinds.items():
            if name in _tables.COLUMNS and name not in self.by and kind is not None and not _is_number(kind):
                raise _core.OhmstrainError(f"column `{name}`: expected numbers, found {kind}")
        if self.texts and ("resistance_ratio" in names) != (self.reading == "resistance_ratio"):
            raise _core.OhmstrainError(f"expected readings as the sensors', `{self.reading}`, found `{','.join(names)}`")

    def needed(self, names: Iterable[str]) -> list[str]:
        """Return the columns that are passed on; a reference only if the task needs it."""
        known = _tables.COLUMNS if self.task in ("evaluate", "calibrate") else _tables.READINGS
        return [name for name in names if name in self.by or name in known]

    def schema(self, keys: Mapping[str, pa.DataType]) -> pa.Schema:
        """Return the schema of the result: keys, columns of the task, warnings and the error."""
        fields = [pa.field(key, keys[key]) for key in self.by]
        if self.task in ("filter", "smooth"):
            fields += [pa.field(name, pa.string() if name == "flags" else pa.float64()) for name in self.columns]
        else:
            fields += [pa.field("sensor_toml", pa.string())] * (self.task == "calibrate")
            fields += [pa.field(name, pa.float64()) for name in SCORES]
        return pa.schema([*fields, pa.field(WARNINGS, pa.string()), pa.field(ERROR, pa.string())])

    def __call__(self, group: pa.Table) -> pa.Table:
        """Return the resulting rows of one group; for a bad group, one row with the error."""
        keys = {key: group[key][0] for key in self.by}
        schema = self.schema({key: group.schema.field(key).type for key in self.by})
        try:
            columns = self._columns(keys, in_order(group))
        except Exception as error:  # noqa: BLE001: any error concerns this recording only.
            columns = _failed(error)
        return _rows(keys, columns, schema)

    def _live(self, keys: Mapping[str, Any], columns: list[str]) -> Any:
        """Return a filter for a group with these columns."""
        sensor = self._sensor(keys)
        suited = sensor if "temperature_c" in columns else sensor.without_temperature()
        return suited._core.live(_options(**self.options), self.about)

    def stream(self, batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        """Do the same for a group in pieces, in order of time, with one piece in memory at a time. For ``filter``."""
        live = None
        for batch in batches:
            group = pa.Table.from_batches([batch])
            keys = {key: group[key][0] for key in self.by}
            schema = self.schema({key: group.schema.field(key).type for key in self.by})
            try:
                live = live or self._live(keys, group.column_names)
                recording = group.select([name for name in group.column_names if name in _tables.COLUMNS])
                yield from _rows(keys, _estimates(*live.run(recording, self.about)), schema).combine_chunks().to_batches()
            except Exception as error:  # noqa: BLE001: as above
                yield from _rows(keys, _failed(error), schema).to_batches()
                for _ in batches:  # The rest of a bad recording is skipped.
                    pass
                return

    def _sensor(self, keys: Mapping[str, Any]) -> Sensor:
        key = None if None in self.texts else keys[self.by[0]].as_py()
        if key not in self._made:
            if key not in self.texts:
                raise _core.OhmstrainError(f"sensors: expected one for {self.by[0]} `{key}`, found none")
            self._made[key] = Sensor.from_toml(self.texts[key])
        return self._made[key]

    def _columns(self, keys: Mapping[str, Any], group: pa.Table) -> dict[str, Any]:
        recording = group.select([name for name in group.column_names if name in _tables.COLUMNS])
        if self.task in ("filter", "smooth"):
            core = self._sensor(keys)._core
            return _estimates(*getattr(core, self.task)(recording, self.about, _options(**self.options)))
        if self.task == "evaluate":
            core = self._sensor(keys)._core
            scored = dict(core.evaluate(recording, self.about, _options(**self.options), float("-inf")))
            scores = {of: json.loads(text) for of, text in scored.items()}
            return _figures(scores["filter"], scores["smoother"], scores["static_cubic"])
        core, doubts = _core.calibrate([(recording, self.about)], _choices(**self.options))
        sensor = Sensor(core)
        found = sensor.findings or {}
        figures = _figures(found.get("filter"), found.get("smoother"), found.get("static_cubic"))
        return {"sensor_toml": pa.array([sensor.to_toml()]), **figures, WARNINGS: _first(doubts, 1)}


def _rows(keys: Mapping[str, Any], columns: Mapping[str, Any], schema: pa.Schema) -> pa.Table:
    """Return rows of the result, with repeated keys, and null for absent columns."""
    rows = len(next(iter(columns.values())))
    found = {**{name: pa.repeat(key, rows) for name, key in keys.items()}, **columns}
    return pa.table([found[f.name] if f.name in found else pa.nulls(rows, f.type) for f in schema], schema=schema)


def _estimates(table: Any, doubts: list[str]) -> dict[str, Any]:
    table = _tables.from_core(table)
    return {**dict(zip(table.column_names, table.columns)), WARNINGS: _first(doubts, len(table))}


def _failed(error: Exception) -> dict[str, Any]:
    return {ERROR: pa.array([f"{type(error).__name__}: {error}"])}


def _first(doubts: list[str], rows: int) -> Any:
    """Return a column with the doubts in the first of ``rows`` rows."""
    if not doubts:
        return pa.nulls(rows, pa.string())
    return pa.concat_arrays([pa.array(["; ".join(doubts)]), pa.nulls(rows - 1, pa.string())])


def in_order(group: pa.Table) -> pa.Table:
    """Sort rows by time, since no engine guarantees an order within a group."""
    time = "time_s" if "time_s" in group.column_names else "time_us"
    times = group[time].combine_chunks()
    if len(times) > 1 and not pc.all(pc.less_equal(times[:-1], times[1:])).as_py():
        group = group.sort_by(time)
    return group


def _is_number(kind: Any) -> bool:
    of = pa.types
    known = (of.is_integer, of.is_floating, of.is_decimal, of.is_null)
    return isinstance(kind, pa.DataType) and any(is_such(kind) for is_such in known)


def _figures(filtered: Any, smoothed: Any, cubic: Any) -> dict[str, Any]:
    cell = lambda scores, name: pa.array([None if scores is None else scores.get(name)], pa.float64())  # noqa: E731
    return {
        "n": cell(filtered, "n"),
        "filter_percent_fs": cell(filtered, "rmse_percent_fs"),
        "smoother_percent_fs": cell(smoothed, "rmse_percent_fs"),
        "static_cubic_percent_fs": cell(cubic, "rmse_percent_fs"),
        "coverage_95": cell(filtered, "coverage_95"),
    }


def _texts(sensors: Any) -> dict[Any, str]:
    """Return sensors as text, by the first key, or one for all under None."""
    text = lambda sensor: sensor.to_toml() if isinstance(sensor, Sensor) else str(sensor)  # noqa: E731
    if isinstance(sensors, Mapping):
        if not sensors:
            raise _core.OhmstrainError("sensors: expected at least one, found none")
        return {key: text(sensor) for key, sensor in sensors.items()}
    if sensors is None:
        raise _core.OhmstrainError("sensors: expected a sensor, or a dict of sensors by the first column of `by`")
    return {None: text(sensors)}
