"""Files in: traces, and what a lab's programs write."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from conftest import run

import ohmstrain as oh
from ohmstrain._read import as_arguments

QUICK = {"estimator": "ekf", "branches": 1}


def same(a, b):
    return all(np.array_equal(a[name].to_numpy(), b[name].to_numpy(), equal_nan=True) for name in ("strain", "strain_sd"))


def test_a_trace(folder, trace, sensor):
    table = oh.read(folder / "trace.csv")
    assert isinstance(table, pa.Table)
    for name in table.column_names:
        np.testing.assert_array_equal(table[name].to_numpy(), trace[name].to_numpy())
    assert same(sensor.smooth(table), sensor.smooth(trace))


def test_what_stands_above_the_header_is_known(folder, trace, sensor):
    """Electronics and a joint: the numbers of the command line, without an argument."""
    spec, joint = "divider reference_ohm=10000 side=low bits=12 noise_codes=0.5", "prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30"
    codes = pd.DataFrame({"time_s": trace["time_s"][:500], "adc": np.arange(500) % 60 + 600})
    (folder / "read.csv").write_text(f"# front_end = {spec}\n# joint = {joint}\n" + codes.to_csv(index=False))
    found = sensor.filter(oh.read(folder / "read.csv"))
    assert "angle_deg" in found.column_names
    expected = sensor.filter(codes, front_end=spec, joint=joint)
    np.testing.assert_array_equal(found["angle_deg"].to_numpy(), expected["angle_deg"].to_numpy())
    with pytest.raises(oh.OhmstrainError, match=r"read.csv: .*front_end"):
        oh.calibrate(oh.read(folder / "read.csv").append_column("strain", [np.linspace(0, 0.3, 500)]), front_end="none")


def test_units_that_a_file_says_are_not_asked_about(folder, trace, tmp_path):
    changed = trace.assign(strain=100 * trace["strain"], resistance_ohm=trace["resistance_ohm"] / 1000)
    rows = changed[["time_s", "resistance_ohm", "strain"]].to_csv(index=False)
    (tmp_path / "bare.csv").write_text(rows)
    (tmp_path / "said.csv").write_text("# strain_unit = percent\n# resistance_unit = kohm\n" + rows)
    with pytest.raises(oh.OhmstrainError, match="bare.csv: .*strain_unit"):
        oh.calibrate(oh.read(tmp_path / "bare.csv"), **QUICK)
    given = oh.read(tmp_path / "bare.csv", strain_unit="percent", resistance_unit="kohm")
    assert given.drop_columns(["time_s"]).equals(oh.read(tmp_path / "said.csv").drop_columns(["time_s"]))
    np.testing.assert_allclose(given["strain"].to_numpy(), trace["strain"], atol=1e-12)
    assert oh.calibrate(given, **QUICK) == oh.calibrate(oh.read(tmp_path / "said.csv"), **QUICK)


def lab(trace, path, header="t (ms),R (kOhm),strain (%)"):
    """As a lab writes it."""
    numbers = np.column_stack([1000 * trace["time_s"], trace["resistance_ohm"] / 1000, 100 * trace["strain"]])
    np.savetxt(path, numbers, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def test_a_labs_file_is_what_import_makes_of_it(trace, tmp_path, sensor):
    lab(trace, tmp_path / "rig.csv")
    run(tmp_path, "import", "rig.csv", "-o", "trace.csv")
    read, imported = oh.read(tmp_path / "rig.csv"), oh.read(tmp_path / "trace.csv")
    for name in ("time_s", "resistance_ohm", "strain"):
        np.testing.assert_array_equal(read[name].to_numpy(), imported[name].to_numpy())
        np.testing.assert_allclose(read[name].to_numpy(), trace[name], rtol=1e-6, atol=1e-9)
    assert same(sensor.smooth(read), sensor.smooth(imported))
    assert oh.calibrate(read, **QUICK) == oh.calibrate(imported, **QUICK)


@pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
@pytest.mark.parametrize(
    ("header", "asks", "answer"),
    [
        ("t (ms),R (kOhm),strain", r'units=\{"strain": "percent"\}', {"units": {"strain": "percent"}}),
        ("t (ms),R (kOhm),strain", r'units=\{"strain": "percent"\}', {"strain_unit": "percent"}),
        ("t (ms),alpha,strain (%)", r'columns=\{"resistance": "NAME"\}', {"columns": {"resistance": "alpha"}, "units": {"resistance": "kohm"}}),
        ("t (ms),R (kOhm),Displacement (mm)", "gauge_length_mm=MM", {"gauge_length_mm": 30}),
    ],
)
def test_questions_name_the_argument(trace, tmp_path, header, asks, answer):
    path = lab(trace, tmp_path / "rig.csv", header)
    with pytest.raises(oh.OhmstrainError, match=asks) as raised:
        oh.read(path)
    assert "--" not in str(raised.value) and raised.value.file == str(path)
    assert {"time_s", "resistance_ohm", "strain"} == set(oh.read(path, **answer).column_names)


def test_two_files(trace, tmp_path):
    lab(trace, tmp_path / "whole.csv")
    whole = pd.read_csv(tmp_path / "whole.csv")
    whole.iloc[:, [0, 1]].to_csv(tmp_path / "meter.csv", index=False)
    whole.iloc[:, [0, 2]].to_csv(tmp_path / "stage.csv", index=False)
    files = (tmp_path / "meter.csv", tmp_path / "stage.csv")
    with pytest.raises(oh.OhmstrainError, match='align="motion" or align="none" or align=SECONDS'):
        oh.read(*files)
    np.testing.assert_allclose(oh.read(*files, align="none")["strain"].to_numpy(), trace["strain"], atol=1e-9)


def test_what_cannot_be_read(tmp_path):
    with pytest.raises(FileNotFoundError):
        oh.read(tmp_path / "none.csv")
    (tmp_path / "bad.csv").write_text("time_s,resistance_ohm\n0,1600\n1,x\n")
    with pytest.raises(oh.OhmstrainError, match="bad.csv:3: column `resistance_ohm`"):
        oh.read(tmp_path / "bad.csv")
    with pytest.raises(oh.OhmstrainError, match="align: expected motion, none or a number of seconds, found `x`"):
        oh.read(tmp_path / "bad.csv", align="x")
    with pytest.raises(oh.OhmstrainError, match="columns: expected one of time.*found `ohms`"):
        oh.read(tmp_path / "bad.csv", columns={"ohms": 2})
    with pytest.raises(oh.OhmstrainError, match="joint: .*, found `x`$") as raised:
        oh.read(tmp_path / "bad.csv", joint="x")
    assert str(raised.value).count("found") == 1
    with pytest.raises(IsADirectoryError) as raised:
        oh.read(tmp_path)
    assert raised.value.filename == str(tmp_path)
    with pytest.raises(TypeError, match="at least one path"):
        oh.read()


@pytest.mark.parametrize(
    ("flags", "arguments"),
    [
        ("say --unit strain=percent or --unit strain=1", 'say units={"strain": "percent"} or units={"strain": "1"}'),
        ("--column 'time=A b': there is none", 'columns={"time": "A b"}: there is none'),
        ("--column time=N --column strain=N (or none)", 'columns={"time": N, "strain": N} (or none)'),
        ("say --decimal 2:, or --skip 3", 'say decimal={2: ","} or skip=3'),
        ("--column temperature=none", 'columns={"temperature": None}'),
        ("1 %: --fold-polarity takes their means", "1 %: fold_polarity=True takes their means"),
        ("--missing 'it'\\''s' or --magnitude strain if", 'missing=["it\'s"] or magnitude=["strain"] if'),
    ],
)
def test_flags_become_arguments(flags, arguments):
    assert as_arguments(flags) == arguments
