"""Running filters that are kept and go on: by pickle, copy and file, and by the command line."""

import ast
import copy
import pickle
import re
import subprocess
import sys
import warnings

import numpy as np
import pandas as pd
import pytest
from conftest import read, run

import ohmstrain as oh

pytestmark = pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
KNOWN = [(10.0, 0.02), (60.0, 0.1)]


@pytest.fixture(scope="module")
def rows(trace):
    """Eighty seconds with readings that are missing, one by one and for ten seconds, and two outliers."""
    part = trace[["time_s", "resistance_ohm"]].head(400).copy()
    part.loc[[7, 30, 31, *range(150, 200)], "resistance_ohm"] = np.nan
    part.loc[[90, 260], "resistance_ohm"] = 9000.0
    return part


def steps(live, rows):
    return [live.step(*row) for row in rows.itertuples(index=False)]


def kept(live, tmp_path, sensor, **options):
    """The same filter by every way."""
    live.save(tmp_path / "state.toml")
    yield pickle.loads(pickle.dumps(live))
    yield copy.copy(live)
    yield copy.deepcopy(live)
    yield sensor.filter(resume=tmp_path / "state.toml", **options)


@pytest.mark.parametrize("options", [{}, {"estimator": "ekf", "gate": 30}, {"influence": "huber:2", "columns": ["time_s", "strain"]}])
def test_a_filter_goes_on_to_the_bit(sensor, rows, tmp_path, options):
    whole = steps(sensor.filter(known=KNOWN, **options), rows)
    for stop in (0, 1, 49, 51, 170, 300):
        live = sensor.filter(known=KNOWN, **options)
        begun = steps(live, rows[:stop])
        for other in kept(live, tmp_path, sensor, **options):
            assert begun + steps(other, rows[stop:]) == whole, stop
        # The one that was kept is as it was.
        assert begun + steps(live, rows[stop:]) == whole


def test_a_lagged_filter_goes_on_with_the_rows_that_wait(sensor, rows, tmp_path):
    def due(lagged, rows):
        return [row for taken in rows.itertuples(index=False) for row in lagged.step(*taken)]

    lagged = sensor.filter(lag_s=1.5, estimator="ekf")
    whole = due(lagged, rows) + lagged.finish()
    assert len(whole) == len(rows)
    for stop in (0, 3, 50, 170, 202):
        lagged = sensor.filter(lag_s=1.5, estimator="ekf")
        begun = due(lagged, rows[:stop])
        for other in kept(lagged, tmp_path, sensor, lag_s=1.5, estimator="ekf"):
            assert begun + due(other, rows[stop:]) + other.finish() == whole, stop


def test_another_process_goes_on(sensor, rows, folder, tmp_path):
    live = sensor.filter()
    begun = steps(live, rows[:120])
    (tmp_path / "live.pickle").write_bytes(pickle.dumps((live, rows[120:])))
    script = (
        "import pickle, sys\n"
        "live, rows = pickle.load(open(sys.argv[1], 'rb'))\n"
        "print([live.step(*row)['strain'].hex() for row in rows.itertuples(index=False)])"
    )
    done = subprocess.run([sys.executable, "-c", script, tmp_path / "live.pickle"], capture_output=True, text=True, check=True)
    assert ast.literal_eval(done.stdout) == [row["strain"].hex() for row in steps(live, rows[120:])] and len(begun) == 120


def test_pieces_of_dates_go_on(sensor, rows):
    moments = rows.assign(time_s=pd.Timestamp("2025-10-31 18:35:45") + pd.to_timedelta(rows["time_s"], unit="s"))
    whole = sensor.filter().run(moments)
    live = sensor.filter()
    first = live.run(moments[:100])
    second = pickle.loads(pickle.dumps(live)).run(moments[100:])
    pd.testing.assert_frame_equal(pd.concat([first, second]), whole)


def test_a_given_r0_is_kept(sensor, rows):
    live = sensor.filter(rest_resistance=1650.0, initial_strain=0.0)
    steps(live, rows[:20])
    live.rest_resistance(1620.0)
    other = pickle.loads(pickle.dumps(live))
    assert steps(other, rows[20:]) == steps(live, rows[20:])


def test_warnings_are_not_repeated(sensor, trace):
    far = trace[["time_s", "resistance_ohm"]].assign(resistance_ohm=2 * trace["resistance_ohm"])
    live = sensor.filter()
    with pytest.warns(oh.OhmstrainWarning, match="outside"):
        live.run(far[:600])
    with warnings.catch_warnings():
        warnings.simplefilter("error", oh.OhmstrainWarning)
        pickle.loads(pickle.dumps(live)).run(far[600:700])


def test_a_state_that_does_not_belong_here(sensor, rows, tmp_path):
    live = sensor.filter()
    steps(live, rows[:5])
    live.save(tmp_path / "state.toml")
    for options, message in [
        ({"gate": 10.8}, "state.toml: the state belongs to a filter with gate none, this one has 10.8; give the same options"),
        ({"lag_s": 0.5}, "lag none, this one has 0.5 s"),
        ({"initial_strain": 0.0}, "initial strain: the first row is over"),
    ]:
        with pytest.raises(oh.OhmstrainError, match=message):
            sensor.filter(resume=tmp_path / "state.toml", **options)
    text = re.sub(r"(strain_sd_scale = )([\d.]+)", lambda found: found[1] + repr(1.01 * float(found[2])), sensor.to_toml(), count=1)
    with pytest.raises(oh.OhmstrainError, match="state.toml: the state belongs to another sensor"):
        oh.Sensor.from_toml(text).filter(resume=tmp_path / "state.toml")
    (tmp_path / "state.toml").write_text(live.state().replace('made_by = "ohmstrain ', 'made_by = "ohmstrain 9'))
    with pytest.raises(oh.OhmstrainError, match="found one of ohmstrain 9"):
        sensor.filter(resume=tmp_path / "state.toml")
    with pytest.raises(TypeError, match="lag_s and resume are for live filters"):
        sensor.filter(rows, resume=tmp_path / "state.toml")


def test_the_command_line_goes_on_from_python_and_back(sensor, rows, folder, tmp_path):
    (folder / "a.csv").write_text(rows[:150].to_csv(index=False))
    (folder / "b.csv").write_text(rows[150:].to_csv(index=False))
    whole = [row["strain"] for row in steps(sensor.filter(), rows)]
    live = sensor.filter()
    steps(live, rows[:150])
    live.save(folder / "python.toml")
    run(folder, "filter", "b.csv", "--sensor", "sensor.toml", "--resume", "python.toml", "-o", "b_estimates.csv")
    assert read(folder / "b_estimates.csv")["strain"].to_list() == whole[150:]
    run(folder, "filter", "a.csv", "--sensor", "sensor.toml", "--save-state", "line.toml", "-o", "a_estimates.csv")
    live = sensor.filter(resume=folder / "line.toml")
    assert [row["strain"] for row in steps(live, rows[150:])] == whole[150:]


def test_a_filter_on_a_joint(sensor, rows, tmp_path):
    joint = "prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30"
    whole, live = sensor.filter(rows, joint=joint), sensor.filter(joint=joint)
    with pytest.raises(oh.OhmstrainError, match=r"joint: expected that of the filter; .*sensor.filter\(joint=…\)"):
        sensor.filter().run(rows, joint=joint)
    first = live.run(rows[:100], joint=joint)
    live.save(tmp_path / "state.toml")
    expected = live.run(rows[100:])
    pd.testing.assert_frame_equal(pd.concat([first, expected]), whole)
    with pytest.raises(oh.OhmstrainError, match="another sensor or joint"):
        sensor.filter(resume=tmp_path / "state.toml")
    for other in (pickle.loads(pickle.dumps(live)), sensor.filter(resume=tmp_path / "state.toml", joint=joint)):
        assert "angle_deg" in other.step(100.0, 1700.0)
    assert sensor.filter(resume=tmp_path / "state.toml", joint=joint).run(rows[100:]).equals(expected)


def test_a_piece_may_be_a_fault(sensor, rows):
    faulty = rows.assign(resistance_ohm=rows["resistance_ohm"].where((rows.index < 100) | (rows.index > 199), 1.5))
    whole, live = sensor.filter(faulty), sensor.filter()
    pd.testing.assert_frame_equal(pd.concat([live.run(faulty[:100]), live.run(faulty[100:200]), live.run(faulty[200:])]), whole)
    live = sensor.filter()
    live.step(*faulty.iloc[0])
    live.run(faulty[100:200])
    with pytest.raises(oh.OhmstrainError, match="kilo-ohms"):
        pickle.loads(pickle.dumps(sensor.filter())).run(faulty[100:200])
    with pytest.raises(oh.OhmstrainError, match="ohms or ratios"):
        live.run(faulty[200:].rename(columns={"resistance_ohm": "resistance_ratio"}))


def test_a_refused_piece_sets_no_zero(sensor, rows):
    moments = rows.assign(time_s=pd.Timestamp("2025-10-31 18:35:45") + pd.to_timedelta(rows["time_s"], unit="s"))
    live = sensor.filter()
    with pytest.raises(oh.OhmstrainError, match="kilo-ohms"):
        live.run(moments.assign(resistance_ohm=rows["resistance_ohm"] / 1000))
    assert live.run(moments[100:200])["time_s"].iloc[0] == 0.0
    assert live.run(moments[200:])["time_s"].iloc[0] == pytest.approx(rows["time_s"][200] - rows["time_s"][100])
