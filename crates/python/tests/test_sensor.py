"""Sensors as objects, filters as they run, plots."""

import pickle
import re
import signal
import threading
import time

import numpy as np
import pytest

import ohmstrain as oh


def test_save_load_pickle(tmp_path, folder, sensor):
    sensor = oh.Sensor.load(folder / "sensor.toml")
    sensor.save(tmp_path / "copy.toml")
    assert (tmp_path / "copy.toml").read_text() == (folder / "sensor.toml").read_text()
    assert pickle.loads(pickle.dumps(sensor)) == sensor
    assert "copy.toml" in repr(sensor) and sensor.estimator == "sign-split" and sensor.quantity == "strain"


def test_a_loaded_sensor_prints_the_same(tmp_path, trace):
    made = oh.calibrate(trace, estimator="ekf", branches=1)
    printed, findings = repr(made).partition("Sensor ")[0], made.findings
    made.save(tmp_path / "sensor.toml")
    for kept in (oh.Sensor.load(tmp_path / "sensor.toml"), pickle.loads(pickle.dumps(made)), made):
        assert kept == made and kept.findings == findings and findings["seen"]["rows"] == len(trace)
        # Its file's name is all that is new.
        assert re.split("Sensor |Written ", repr(kept))[0] == printed and "Record next" in printed
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    figures = [sensor.plot.calibration() for sensor in (made, oh.Sensor.load(tmp_path / "sensor.toml"))]
    shown = [[[patch.get_height() for patch in axes.patches if hasattr(patch, "get_height")] for axes in f.axes] for f in figures]
    assert len(figures[1].axes) == 3 and shown[0] == shown[1]


def test_a_file_that_cannot_be_written(tmp_path, sensor):
    (tmp_path / "folder").mkdir()
    for works in (sensor.save, sensor.filter().save, oh.Prior.fit([sensor] * 3).save):
        for name, error in (("folder", IsADirectoryError), ("none/sensor.toml", FileNotFoundError)):
            with pytest.raises(error) as raised:
                works(tmp_path / name)
            assert raised.value.filename == str(tmp_path / name) and raised.value.filename2 is None
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_a_bad_file_is_named(tmp_path, folder):
    path = tmp_path / "bad.toml"
    path.write_text((folder / "sensor.toml").read_text().replace("rest_reading = ", "rest_reading = -", 1))
    with pytest.raises(oh.OhmstrainError, match=r"bad.toml:\d+: column \d+"):
        oh.Sensor.load(path)


def test_live_is_the_filter(trace, sensor):
    rows = trace.head(100)
    expected = sensor.filter(rows)
    live, pieces = sensor.filter(), sensor.filter()
    for row, (time_s, reading) in enumerate(zip(rows["time_s"], rows["resistance_ohm"])):
        assert live.step(time_s, reading)["strain"] == expected["strain"][row]
    found = [pieces.run(rows.iloc[at : at + 33]) for at in range(0, 100, 33)]
    np.testing.assert_array_equal(np.concatenate([piece["strain"] for piece in found]), expected["strain"])
    with pytest.raises(oh.OhmstrainError):
        live.step(0.0, 1600.0)
    assert live.step(1e3, None)["flags"].split("|")[0] == "missing"
    lagged = sensor.filter(lag_s=0.5)
    out = [row for time_s, reading in zip(rows["time_s"], rows["resistance_ohm"]) for row in lagged.step(time_s, reading)]
    out += lagged.finish()
    assert [row["time_s"] for row in out] == list(rows["time_s"])


def test_wrong_options_are_named(sensor):
    with pytest.raises(oh.OhmstrainError, match="sign-split"):
        sensor.filter(estimator="kalman")
    with pytest.raises(oh.OhmstrainError, match="huber:K"):
        sensor.filter(influence="huber")
    with pytest.raises(oh.OhmstrainError, match="columns: expected some of time_s,.*found `strian`"):
        sensor.filter(columns=["strian"])
    with pytest.raises(oh.OhmstrainError, match="columns: expected some of time_s,.*found none"):
        sensor.filter(columns=[])
    for known in ((float("nan"), 0.1), (1.0, float("inf")), (1.0, 0.1, 0.0)):
        with pytest.raises(oh.OhmstrainError, match=r"known: expected \(time_s, strain\) or .*, found \("):
            sensor.filter(known=[known])
    with pytest.raises(oh.OhmstrainError, match="initial strain"):
        sensor.filter(initial_strain=10.0)
    with pytest.raises(TypeError):
        sensor.filter(gait=1)


@pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
def test_warns_beyond_the_calibration(trace, sensor):
    beyond = trace.assign(resistance_ohm=trace["resistance_ohm"] * 3)
    with pytest.warns(oh.OhmstrainWarning, match="outside of the calibration") as warned:
        sensor.filter(beyond)
    assert all(one.filename == __file__ for one in warned)


def test_the_interpreter_is_free_meanwhile(trace, sensor):
    """Another thread goes on counting while a smoother runs, which holds the lock for no longer than a switch."""
    long = {"time_s": np.arange(60_000) * 0.2, "resistance_ohm": np.resize(trace["resistance_ohm"].to_numpy(), 60_000)}
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    with pytest.warns(oh.OhmstrainWarning):
        sensor.smooth(long)
    end = time.perf_counter()
    done.set()
    thread.join()
    inside = [at for at in ticks if start + 0.1 * (end - start) < at < end - 0.1 * (end - start)]
    # Of a millisecond each, half would do for a busy machine; with the lock held there is none.
    assert len(inside) > 5, (len(inside), end - start)


@pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
def test_an_interrupt_stops_the_run(trace, sensor):
    """What a signal's handler raises comes out of the work that it meets."""
    rows = 40_000
    readings, strain = (np.resize(trace[name].to_numpy(), rows) for name in ("resistance_ohm", "strain"))
    long = {"time_s": np.arange(rows) * 0.2, "resistance_ohm": readings, "strain": strain}
    works = [sensor.filter, sensor.smooth, sensor.evaluate, sensor.filter().run, lambda _: oh.calibrate(trace, estimator="ekf")]
    before = signal.signal(signal.SIGALRM, lambda *_: (_ for _ in ()).throw(InterruptedError))
    try:
        for work in works:
            with pytest.raises(InterruptedError):
                signal.setitimer(signal.ITIMER_REAL, 0.005)
                work(long)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_threads_take_turns_with_a_filter(trace, sensor):
    """One runs through tables while another steps and has the interpreter: neither waits for ever."""
    live, done = sensor.filter(), []

    def rows(first):
        times = np.arange(first, first + 20_000) * 1e-6
        return {"time_s": times, "resistance_ohm": np.resize(trace["resistance_ohm"].to_numpy(), len(times))}

    def run():
        for k in range(5):
            done.append(live.run(rows(20_000 * k)))

    thread = threading.Thread(target=run)
    thread.start()
    while thread.is_alive():
        try:
            live.step(0.0, 1600.0)
        except oh.OhmstrainError:
            pass
    thread.join()
    assert len(done) == 5


def test_plots(trace, sensor):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    estimates = sensor.smooth(trace.head(300))
    figure = oh.plot.strain(estimates, trace.head(300))
    assert {line.get_label() for line in figure.axes[0].lines} == {"estimate", "reference"}
    moved = trace.head(300).rename(columns={"strain": "displacement_mm"}).assign(displacement_mm=30 * trace["strain"])
    lines = [oh.plot.strain(estimates, moved, gauge_length_mm=length).axes[0].lines for length in (None, 30)]
    assert [len(each) for each in lines] == [1, 2]
    np.testing.assert_allclose(lines[1][1].get_ydata(), 100 * trace["strain"].head(300))
    first = trace.head(300)
    micro = first.drop(columns="time_s").assign(time_us=1e6 * first["time_s"])
    percent = first.assign(strain=100 * first["strain"])
    for table, unit in ((micro, None), (percent, "percent")):
        reference = oh.plot.strain(estimates, table, strain_unit=unit).axes[0].lines[1]
        np.testing.assert_allclose(reference.get_xdata(), first["time_s"])
        np.testing.assert_allclose(reference.get_ydata(), 100 * first["strain"])
    with pytest.raises(oh.OhmstrainError, match='in percent\\? Then say so with strain_unit="percent"'):
        oh.plot.strain(estimates, percent)
    # A file of an older version says less.
    summary = sensor.to_toml().split("\n[findings")[0]
    assert len(oh.Sensor.from_toml(summary).plot.calibration().axes) == 1
    made = oh.calibrate(trace, estimator="ekf")
    assert len(made.plot.calibration().axes) == 3
    # g(0) = 0, and the curve of the report at one strain, written out.
    line = made.plot.gauge().axes[0].lines[0]
    a, b, c = made.params["law"]["gauge"]["coefficients"]
    e, g = line.get_xdata()[50] / 100, line.get_ydata()[50] / 100
    assert g == pytest.approx(a * e + b * e**2 + c * e**3)
