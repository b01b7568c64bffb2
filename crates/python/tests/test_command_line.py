"""The same numbers as the command line prints, to the last digit."""

import io
import json

import numpy as np
import pandas as pd
import pytest
from conftest import read, run

import ohmstrain as oh

pytestmark = pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")


def same(table, printed):
    expected = read(io.StringIO(printed))
    assert list(table.columns) == list(expected.columns)
    numbers = [name for name in expected.columns if name != "flags"]
    for name in numbers:
        np.testing.assert_array_equal(table[name].to_numpy(float), expected[name].to_numpy(float), err_msg=name)
    assert (table["flags"] == expected["flags"]).all()


OPTIONS = [
    ((), {}),
    (("--estimator", "ekf"), {"estimator": "ekf"}),
    (("--gate", "10.8", "--initial-strain", "0"), {"gate": 10.8, "initial_strain": 0.0}),
    (("--influence", "huber:2", "--rest-resistance", "1580"), {"influence": "huber:2", "rest_resistance": 1580.0}),
    (("--known", "3:0.1", "--known", "5:0.12:0.001"), {"known": [(3.0, 0.1), (5.0, 0.12, 0.001)]}),
    (("--rest-resistance", "calibrated"), {"rest_resistance": "calibrated"}),
]


@pytest.mark.parametrize(("flags", "options"), OPTIONS)
def test_filter_and_smooth(folder, trace, sensor, flags, options):
    for command in ("filter", "smooth"):
        printed = run(folder, command, "trace.csv", "--sensor", "sensor.toml", *flags)
        same(getattr(sensor, command)(trace, **options), printed)


def test_gaps_and_codes(folder, trace, sensor):
    gappy = trace.copy()
    gappy.loc[100:120, "resistance_ohm"] = np.nan
    gappy.to_csv(folder / "gappy.csv", index=False)
    same(sensor.smooth(gappy), run(folder, "smooth", "gappy.csv", "--sensor", "sensor.toml"))
    spec = "divider reference_ohm=10000 side=low bits=12 noise_codes=0.5"
    codes = pd.DataFrame({"time_s": trace["time_s"][:500], "adc": np.arange(500) % 60 + 600})
    codes.loc[3, "adc"] = 4095
    (folder / "codes.csv").write_text(f"# front_end = {spec}\n" + codes.to_csv(index=False))
    printed = run(folder, "filter", "codes.csv", "--sensor", "sensor.toml")
    assert "saturated" in printed
    same(sensor.filter(codes, front_end=spec), printed)


def test_calibrate(folder, trace):
    made = oh.calibrate([trace[trace["time_s"] < 300]], estimator="sign-split")
    written = oh.Sensor.load(folder / "sensor.toml").params
    # The command tested it on the rows after 300 s, which Python was not given.
    assert written.pop("tested")["coverage_95_percent"] > 0
    stated = [{"filter_sd": 0.0, "smoother_sd": 0.0, **params.get("unstated", {})} for params in (made.params, written)]
    assert all(stated[0][name] <= stated[1][name] for name in stated[0])
    assert {**made.params, "unstated": None, "recordings": None} == {**written, "unstated": None, "recordings": None}
    lines = repr(made).splitlines()
    assert lines[0].startswith("Verdict ") and lines[-1].startswith("Sensor ") and len(lines) <= 10
    printed = run(folder, "calibrate", "trace.csv", "--until", "300", "-o", "again.toml", "--estimator", "sign-split", "--json")
    assert made.findings == json.loads(printed)["left_out"]


@pytest.mark.parametrize(
    ("flags", "options"),
    [(("--target", "c"), {}), (("--target", "rust", "--dt-s", "0.1"), {"target": "rust", "dt_s": 0.1}), (("--target", "c", "--budget", "board=nano33ble"), {"budget": "board=nano33ble"})],
)
def test_export(folder, sensor, tmp_path, flags, options):
    printed = run(folder, "export", "--sensor", "sensor.toml", "-o", str(tmp_path / "theirs"), *flags)
    promise = sensor.export(tmp_path / "ours", **options)
    assert printed.splitlines()[-1].startswith(promise.splitlines()[-1])
    assert "\n".join(promise.splitlines()[:-1]) in printed
    theirs, ours = ({path.relative_to(of): path.read_bytes() for path in of.rglob("*.*")} for of in (tmp_path / "theirs", tmp_path / "ours"))
    assert theirs == ours


def test_export_refuses(sensor, tmp_path):
    for wrong, text in (
        ({"target": "ada"}, "target: expected c or rust, found `ada`"),
        ({"dt_s": -1.0}, "dt_s: expected a positive number, found -1"),
        ({"budget": "flash=10"}, "budget: nothing fits"),
        ({"prefix": "9"}, "prefix: "),
    ):
        with pytest.raises(oh.OhmstrainError, match=text):
            sensor.export(tmp_path / "none", **wrong)
    assert not (tmp_path / "none").exists()


def test_evaluate(folder, trace, sensor):
    printed = json.loads(run(folder, "evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", "300", "--json"))
    compare(sensor.evaluate(trace, from_s=300.0), printed["recordings"][0])
    printed = json.loads(run(folder, "evaluate", "trace.csv", "--splits", "0.5", "--estimator", "ekf", "--json"))
    [evaluation] = oh.evaluate(trace, splits=[0.5], estimator="ekf")
    compare(evaluation, printed["recordings"][0])
    assert set(evaluation) >= {"fir_20s", "low_pass_mode", "leaky_bank"}
    with pytest.raises(TypeError, match="split"):
        oh.evaluate(trace, split=[0.3], estimator="ekf")


def compare(evaluation, printed):
    for of in evaluation:
        expected = printed if of == "filter" else printed["smoother"] if of == "smoother" else printed["baselines"][of]
        for name in ("n", "rmse", "bias", "rmse_percent_fs", "coverage_95", "log_score"):
            assert getattr(evaluation[of], name) == expected[name], (of, name)


def test_a_prior(folder, trace, sensor, tmp_path):
    run(folder, "fleet", "fit", "sensor.toml", "sensor.toml", "sensor.toml", "-o", "prior.toml")
    prior = oh.Prior.fit([sensor] * 3)
    prior.save(tmp_path / "prior.toml")
    assert (tmp_path / "prior.toml").read_text() == (folder / "prior.toml").read_text()
    flags = ("--until", "20", "--estimator", "sign-split", "--prior", "prior.toml")
    run(folder, "calibrate", "trace.csv", "-o", "taught.toml", *flags)
    short = trace[trace["time_s"] < 20]
    taught = oh.calibrate(short, estimator="sign-split", prior=prior).params
    expected = oh.Sensor.load(folder / "taught.toml").params
    assert [taught[part] for part in ("law", "estimators")] == [expected[part] for part in ("law", "estimators")]
    with pytest.raises(oh.OhmstrainError, match="format"):
        oh.calibrate(short, prior=folder / "sensor.toml")
