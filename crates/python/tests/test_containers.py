"""Containers that other packages read: MATLAB, HDF5, ROS bags, MCAP."""

import json
import sys

import numpy as np
import pytest
from test_examples import BEGIN, needed, write_ros1, write_ros2

import ohmstrain as oh

pytestmark = pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
COLUMNS = ("time_s", "resistance_ohm", "strain")


@pytest.fixture(scope="module")
def bench(trace):
    return {name: trace[name].head(100).to_numpy() for name in COLUMNS}


def same(table, bench, names=COLUMNS):
    assert table.column_names == list(names)
    for name in names:
        np.testing.assert_array_equal(table[name].to_numpy(), bench[name], err_msg=name)
    return True


def test_matlab_5(bench, tmp_path):
    io = needed("scipy.io")
    path = tmp_path / "run.mat"
    io.savemat(path, {**bench, "fs": 5.0, "who": "somebody"})
    table = oh.read(path)
    assert same(table, bench)
    assert json.loads(table.schema.metadata[b"ohmstrain"])["name"] == str(path)
    # A struct, and a matrix whose rows are those of the bench, beside something else.
    io.savemat(path, {"run": bench, "all": np.column_stack(list(bench.values())), "gains": np.arange(7.0)})
    assert same(oh.read(path, sheet="run"), bench)
    named = {"time": "all[1]", "resistance": "all[2]", "strain": "all[3]"}
    assert same(oh.read(path, columns=named, units={"time": "s", "resistance": "ohm", "strain": "fraction"}), bench)
    with pytest.raises(oh.OhmstrainError, match=r"run.mat: arrays of several lengths.*`gains` \(7\).*columns=\{") as raised:
        oh.read(path)
    assert raised.value.file == str(path)
    with pytest.raises(oh.OhmstrainError, match=r"expected columns of one length, found `all\[1\]` \(100\), `gains` \(7\)"):
        oh.read(path, columns={"time": "all[1]", "resistance": "gains"})
    io.savemat(path, {"who": "somebody"})
    with pytest.raises(oh.OhmstrainError, match="expected arrays of numbers, found none; of a MATLAB table save table2struct"):
        oh.read(path)


def test_two_matlab_files(bench, tmp_path):
    """`sheet` is that of both, and a column of the second file has its number, among arrays of several lengths, too."""
    io = needed("scipy.io")
    meter = {"t": bench["time_s"], "R": bench["resistance_ohm"]}
    stage = {"clock": bench["time_s"], "pos": bench["strain"], "gains": np.arange(7.0)}
    for path, run in (("a.mat", meter), ("b.mat", stage)):
        io.savemat(tmp_path / path, {"one": run, "two": {name: values[:5] for name, values in run.items()}})
    units = {"time": "s", "resistance": "ohm", "strain": "fraction"}
    for prefix, sheet in (("", "one"), ("one.", None)):
        columns = {"time": f"{prefix}t", "resistance": f"{prefix}R", "reference-time": f"2:{prefix}clock", "strain": f"2:{prefix}pos"}
        found = oh.read(tmp_path / "a.mat", tmp_path / "b.mat", sheet=sheet, columns=columns, units=units, align="none")
        assert same(found, bench)


def test_hdf5_and_matlab_7_3(bench, tmp_path):
    h5py = needed("h5py")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, values in bench.items():
            file[f"trials/1/{name}"] = values
            file[f"trials/2/{name}"] = values[:50]
        file["table"] = np.rec.fromarrays(list(bench.values()), names=list(bench))
    assert same(oh.read(tmp_path / "run.h5", sheet="trials/1"), bench)
    assert oh.read(tmp_path / "run.h5", sheet="trials/2").num_rows == 50
    # As MATLAB writes it: a header of 512 bytes, columns as rows, texts as numbers.
    with h5py.File(tmp_path / "v73.mat", "w", userblock_size=512) as file:
        for name, values in bench.items():
            file[name] = values[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["who"] = np.frombuffer("somebody".encode("utf-16-le"), dtype="uint16")[None, :]
        file["who"].attrs["MATLAB_class"] = np.bytes_("char")
        file["#refs#/a"] = np.arange(5.0)
    with open(tmp_path / "v73.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))
    assert same(oh.read(tmp_path / "v73.mat"), bench)
    # Results are those of the columns themselves.
    quick = {"estimator": "ekf", "branches": 1}
    assert oh.calibrate(oh.read(tmp_path / "v73.mat"), **quick) == oh.calibrate(bench, **quick)


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP", "file in a bag", "mcap alone"])
def test_bags(bench, tmp_path, kind):
    rows = [(round(1e9 * time_s), ohm) for time_s, ohm in zip(bench["time_s"], bench["resistance_ohm"])]
    if kind == "ros1":
        bag = write_ros1(tmp_path / "run.bag", rows)
    elif kind == "mcap alone":
        needed("mcap_ros2.decoder")
        [inside] = write_ros2(tmp_path / "run", rows).glob("*.mcap")
        bag = inside.rename(tmp_path / "alone.mcap")
    else:
        bag = write_ros2(tmp_path / "run", rows, "MCAP" if kind == "MCAP" else "SQLITE3")
        bag = next(bag.glob("*.db3")) if kind == "file in a bag" else bag
    for options in ({}, {"sheet": "/resistance_ohm"}):
        assert same(oh.read(bag, **options), bench, ("time_s", "resistance_ohm"))
    if kind != "ros1":
        with pytest.raises(oh.OhmstrainError, match="no numbers in the topic `/said`"):
            oh.read(bag, sheet="/said")


def test_mcap_of_json_with_two_topics(bench, tmp_path):
    needed("mcap.reader")
    from mcap.writer import Writer

    with open(tmp_path / "run.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channels = [writer.register_channel(topic, "json", schema) for topic in ("/glove", "/stage")]
        for time_s, ohm, strain in zip(*bench.values()):
            time_ns = BEGIN + round(1e9 * time_s)
            glove, stage = {"resistance_ohm": ohm, "name": "index"}, {"pose": {"strain": strain}}
            for channel, message in zip(channels, (glove, stage)):
                writer.add_message(channel, time_ns, json.dumps(message).encode(), time_ns)
        writer.finish()
    with pytest.raises(oh.OhmstrainError, match="several topics with numbers: say sheet=TOPIC, one of `/glove`, `/stage`"):
        oh.read(tmp_path / "run.mcap")
    assert same(oh.read(tmp_path / "run.mcap", sheet="/glove"), bench, ("time_s", "resistance_ohm"))


def test_stamps_of_headers(bench, tmp_path):
    """They are the times, whatever the clock that logged the messages said."""
    rosbag1, typesys = needed("rosbags.rosbag1"), needed("rosbags.typesys")
    store, kind = typesys.get_typestore(typesys.Stores.ROS1_NOETIC), "sensor_msgs/msg/FluidPressure"
    with rosbag1.Writer(tmp_path / "run.bag") as writer:
        topic = writer.add_connection("/glove", kind, typestore=store)
        for k, (time_s, ohm) in enumerate(zip(bench["time_s"], bench["resistance_ohm"])):
            sec, nanosec = divmod(BEGIN + round(1e9 * time_s), 10**9)
            stamp = store.types["builtin_interfaces/msg/Time"](sec, nanosec)
            header = store.types["std_msgs/msg/Header"](k, stamp, "glove")
            message = store.types[kind](header, ohm, 0.0)
            writer.write(topic, BEGIN + k * 10**6, store.serialize_ros1(message, kind))
    named = {"resistance": "fluid_pressure"}
    assert same(oh.read(tmp_path / "run.bag", columns=named, units={"resistance": "ohm"}), bench, ("time_s", "resistance_ohm"))


@pytest.mark.parametrize("start", [b"MATLAB 5.0 MAT-file", b"\x89HDF\r\n\x1a\n", b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n"])
def test_a_damaged_file_is_named(tmp_path, start):
    for module in ("scipy.io", "h5py", "rosbags.highlevel", "mcap.reader"):
        needed(module)
    (tmp_path / "cut.bin").write_bytes(start.ljust(600, b"\1"))
    with pytest.raises(oh.OhmstrainError, match="cut.bin: (cannot be read|expected arrays|no topic)"):
        oh.read(tmp_path / "cut.bin")


@pytest.mark.parametrize(
    ("module", "package", "start"),
    [
        ("scipy.io", "scipy", b"MATLAB 5.0 MAT-file"),
        ("h5py", "h5py", b"\x89HDF\r\n\x1a\n"),
        ("rosbags.highlevel", "rosbags", b"#ROSBAG V2.0\n"),
        ("mcap.reader", "mcap", b"\x89MCAP0\r\n"),
    ],
)
def test_a_missing_package_is_named(tmp_path, monkeypatch, module, package, start):
    (tmp_path / "run.bin").write_bytes(start.ljust(600, b"\0"))
    for name in (module, module.split(".")[0]):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(oh.OhmstrainError, match=f"run.bin: .* is read by the package {package}, .*: pip install {package}"):
        oh.read(tmp_path / "run.bin")
