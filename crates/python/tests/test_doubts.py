"""What the command line refuses or warns of, Python refuses or warns of, and an argument answers it."""

import numpy as np
import pytest

import ohmstrain as oh
from conftest import ROOT

QUICK = {"estimator": "ekf", "branches": 1}


def exchanged(trace):
    return trace.assign(resistance_ohm=trace["strain"].clip(lower=1e-3), strain=trace["resistance_ohm"])


@pytest.mark.parametrize(
    ("change", "text", "answer"),
    [
        (lambda t: t.assign(strain=100 * t["strain"]), 'strain_unit="percent"', {"strain_unit": "percent"}),
        (lambda t: t.assign(resistance_ohm=t["resistance_ohm"] / 1000), 'resistance_unit="kohm"', {"resistance_unit": "kohm"}),
        (lambda t: t.assign(strain=t["strain"].shift(20, fill_value=0.0)), "align=True", {"align": True}),
        (exchanged, "`resistance_ohm` and `strain` seem to be exchanged", None),
    ],
)
@pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
def test_calibrate_asks(trace, change, text, answer):
    changed = change(trace)
    with pytest.raises(oh.OhmstrainError, match=text) as raised:
        oh.calibrate({"monday": changed}, **QUICK)
    assert str(raised.value).startswith("monday: ") and raised.value.file == "monday"
    if answer is None:
        return
    made, plain = oh.calibrate({"monday": changed}, **QUICK, **answer), oh.calibrate(trace, **QUICK)
    span = [sensor.params["limits"]["upper"] for sensor in (made, plain)]
    assert span[0] == pytest.approx(span[1], rel=0.05)
    assert made.params["rest_reading"] == pytest.approx(plain.params["rest_reading"], rel=0.05)


def test_what_is_moved_or_taken_twice_is_warned_of(trace):
    late = trace.assign(strain=trace["strain"].shift(20, fill_value=0.0))
    with pytest.warns(oh.OhmstrainWarning, match=r"recording 1: the reference is [34]\.\d\d ± \d\.\d\d s late; it was moved by that"):
        oh.calibrate(late, **QUICK, align=True)
    with pytest.warns(oh.OhmstrainWarning, match="recording 2 and recording 1: the same rows: they count twice"):
        oh.calibrate([trace, trace], **QUICK)
    with pytest.warns(oh.OhmstrainWarning, match="a and b: R0 comes out as .* 50 % more: one sensor?"):
        oh.calibrate({"a": trace, "b": trace.assign(resistance_ohm=1.5 * trace["resistance_ohm"])}, **QUICK)
    with pytest.raises(oh.OhmstrainError, match="a and b: readings of about .* Then multiply its column by 1000"):
        oh.calibrate({"b": trace, "a": trace.assign(resistance_ohm=trace["resistance_ohm"] / 40)}, **QUICK)


def test_units_are_answered_where_readings_enter(trace, sensor):
    rows = trace.head(300)
    kohm, percent = rows.assign(resistance_ohm=rows["resistance_ohm"] / 1000), rows.assign(strain=100 * rows["strain"])
    for work in (sensor.filter, sensor.smooth, sensor.evaluate, sensor.filter().run):
        with pytest.raises(oh.OhmstrainError, match='in kilo-ohms\\? Then say so with resistance_unit="kohm"'):
            work(kohm)
    for name in ("filter", "smooth"):
        found, expected = getattr(sensor, name)(kohm, resistance_unit="kohm"), getattr(sensor, name)(rows)
        np.testing.assert_allclose(found["strain"], expected["strain"], atol=1e-8)
    with pytest.raises(oh.OhmstrainError, match='in percent\\? Then say so with strain_unit="percent"') as raised:
        sensor.evaluate(percent)
    assert raised.value.column == "strain"
    found = sensor.evaluate(percent, strain_unit="percent").filter.rmse
    assert found == pytest.approx(sensor.evaluate(rows).filter.rmse, rel=1e-9)
    with pytest.raises(oh.OhmstrainError, match="strain_unit: expected .*`percent`.*`promille`"):
        sensor.evaluate(percent, strain_unit="promille")


def test_a_rest_resistance_of_no_such_sensor_is_refused(trace, sensor):
    rested = sensor.params.get("measured_rest", sensor.params["rest_reading"])
    live, lagged = sensor.filter(), sensor.filter(lag_s=0.5)
    works = [
        lambda far: sensor.filter(trace, rest_resistance=far),
        lambda far: sensor.smooth(trace, rest_resistance=far),
        lambda far: sensor.evaluate(trace, rest_resistance=far),
        lambda far: sensor.filter(rest_resistance=far),
        lambda far: sensor.filter(rest_resistance=far, lag_s=0.5),
        live.rest_resistance,
        lagged.rest_resistance,
    ]
    for factor in (1e-3, 0.2, 9.0):
        for work in works:
            with pytest.raises(oh.OhmstrainError, match="rest_resistance: resistance at rest: expected .* found"):
                work(factor * rested)
    live.rest_resistance(2 * rested)


@pytest.mark.filterwarnings("default::ohmstrain.OhmstrainWarning")
def test_known_strains_that_say_nothing_and_rests_are_warned_of(trace, sensor):
    upper = sensor.params["limits"]["upper"]
    for work in (sensor.filter, sensor.smooth):
        with pytest.warns(oh.OhmstrainWarning, match=r"known: \(9000, 0.1\) was not used: the recording goes from"):
            work(trace.head(50), known=[(9000.0, 0.1)])
        with pytest.warns(oh.OhmstrainWarning, match="initial_strain: .* is outside of the sensor's limits"):
            work(trace.head(50), initial_strain=1.02 * upper)


@pytest.mark.filterwarnings("default::ohmstrain.OhmstrainWarning")
def test_readings_that_hold_still_near_rest_may_be_a_rest_of_another_day():
    sensor = oh.Sensor.load(ROOT / "crates/ohmstrain/examples/sensor.toml")
    held = 1.1 * sensor.params["measured_rest"]
    time_s = np.arange(0.0, 400.0, 0.2)
    noise = np.random.default_rng(1).normal(0.0, 0.3, len(time_s))
    moving = 1.6 * held + 0.55 * held * np.sin(time_s)
    rest = {"time_s": time_s, "resistance_ohm": np.where(time_s < 60.0, moving, held + noise)}
    with pytest.warns(oh.OhmstrainWarning, match=r"s of quiet readings from .* add known=\[\(.*, 0\)\]"):
        sensor.filter(rest)
