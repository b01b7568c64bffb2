"""Spark, Ray and Dask, as they run on one machine; skipped where they are not installed, unless OHMSTRAIN_REQUIRE_ENGINES=1."""

import os
import sys

import pytest
from test_groups import check, fleet

import ohmstrain as oh


def engine(name):
    if os.environ.get("OHMSTRAIN_REQUIRE_ENGINES") == "1":
        __import__(name)
    return pytest.importorskip(name)


@pytest.fixture(scope="module")
def spark():
    engine("pyspark")
    os.environ["PYSPARK_PYTHON"] = sys.executable
    from pyspark.sql import SparkSession

    settings = {
        "spark.ui.enabled": "false",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.driver.host": "127.0.0.1",
        "spark.sql.shuffle.partitions": "4",
    }
    builder = SparkSession.builder.master("local[2]")
    for key, value in settings.items():
        builder = builder.config(key, value)
    session = builder.getOrCreate()
    yield session
    session.stop()


def test_spark(spark, trace, sensor):
    from ohmstrain import spark as oh_spark

    table = fleet(trace)
    df = spark.createDataFrame(table).repartition(3)
    sensors = {"left": sensor, "right": sensor}
    check(oh_spark.smooth(df, sensors).toPandas(), table, sensor)
    if tuple(int(part) for part in spark.version.split(".")[:2]) >= (4, 1):
        whole = oh_spark.filter(df, sensors).orderBy("recording_id", "time_s").toPandas()
        pieces = oh_spark.filter(df, sensors, streaming=True).orderBy("recording_id", "time_s").toPandas()
        good = [frame[~frame["recording_id"].isin([2])].reset_index(drop=True) for frame in (whole, pieces)]
        assert good[0].equals(good[1])
        assert pieces["error"].notna().sum() == 1
    scores = oh_spark.evaluate(df, sensors).toPandas()
    assert len(scores) == 4 and scores["error"].notna().sum() == 1
    with pytest.raises(oh.OhmstrainError, match="no_such"):
        oh_spark.smooth(df, sensor, by=["no_such"])
    with pytest.raises(oh.OhmstrainError, match="`time_s`: expected numbers"):
        oh_spark.smooth(df.withColumn("time_s", df.time_s.cast("string")), sensor)
    made = oh_spark.calibrate(df.where("recording_id = 1"), estimator="ekf").toPandas()
    assert oh.Sensor.from_toml(made["sensor_toml"][0]).estimator == "ekf"


@pytest.fixture(scope="module")
def ray():
    ray = engine("ray")
    from ray.data import DataContext

    ray.init(num_cpus=2, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)
    DataContext.get_current().default_hash_shuffle_parallelism = 4
    yield ray
    ray.shutdown()


def test_ray(ray, trace, sensor):
    from ohmstrain import ray as oh_ray

    table = fleet(trace)
    ds = ray.data.from_pandas(table)
    check(oh_ray.smooth(ds, {"left": sensor, "right": sensor}).to_pandas(), table, sensor)
    with pytest.raises(oh.OhmstrainError, match="`time_s`: expected numbers"):
        oh_ray.smooth(ray.data.from_pandas(table.assign(time_s="x")), sensor)


def test_dask(trace, sensor):
    engine("dask")
    import dask.dataframe as dd

    from ohmstrain import dask as oh_dask

    table = fleet(trace)
    df = dd.from_pandas(table, npartitions=3)
    sensors = {"left": sensor, "right": sensor}
    check(oh_dask.smooth(df, sensors).compute(), table, sensor)
    scores = oh_dask.evaluate(df, sensors).compute()
    assert len(scores) == 4 and scores["error"].notna().sum() == 1
    with pytest.raises(oh.OhmstrainError, match="no_such"):
        oh_dask.smooth(df, sensor, by=["no_such"])
    with pytest.raises(oh.OhmstrainError, match="`time_s`: expected numbers"):
        oh_dask.smooth(df.assign(time_s="x"), sensor)
