"""The examples of other programs' data run from their own text, against the real counterparts from PyPI."""

import ast
import json
import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import run

import ohmstrain as oh

EXAMPLES = Path(__file__).parents[1] / "examples"
#: Longer than anything takes on a busy machine, s.
PATIENCE = 60
pytestmark = pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")


def needed(module):
    """The counterpart; where the examples must run it is there."""
    if os.environ.get("OHMSTRAIN_REQUIRE_EXAMPLES"):
        __import__(module)
    return pytest.importorskip(module)


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def running(name, *words, says=None, **environment):
    """An example while it runs, from the line on that it says."""
    command = [sys.executable, "-W", "ignore", str(EXAMPLES / name), *map(str, words)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, text=True, env={**os.environ, **environment}, **pipes)
    try:
        if says:
            line = process.stdout.readline()
            assert says in line, process.stderr.read()
        yield process
    finally:
        process.kill()
        process.communicate()


def done(name, *words):
    """What an example prints that ends by itself."""
    command = [sys.executable, "-W", "ignore", str(EXAMPLES / name), *map(str, words)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10 * PATIENCE)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def rows(trace):
    """Thirty readings, and their times in whole nanoseconds."""
    ohms = trace["resistance_ohm"].head(30).to_list()
    return [(200_000_000 * k, ohm) for k, ohm in enumerate(ohms)]


@pytest.fixture(scope="module")
def expected(sensor, rows):
    """Strain and its deviation of each."""
    live = sensor.filter()
    estimates = [live.step(time_ns / 1e9, ohm) for time_ns, ohm in rows]
    return [(row["strain"], row["strain_sd"]) for row in estimates]


def test_they_are_short_and_listed():
    docs = (EXAMPLES.parents[2] / "docs/python.md").read_text(encoding="utf-8")
    for path in set(EXAMPLES.glob("*.py")) - {EXAMPLES / "fleet.py"}:
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= 50 and path.name in docs, path.name
        assert ".filter()" in text or "StrainRegressor" in text, path.name


def test_udp(folder, rows, expected):
    port, back = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", back))
        udp.settimeout(PATIENCE)
        with running("udp.py", folder / "sensor.toml", port, f"127.0.0.1:{back}", says="waiting"):
            udp.sendto(b"no numbers\n", ("127.0.0.1", port))
            found = []
            for time_ns, ohm in rows:
                udp.sendto(f"{time_ns / 1e9!r},{ohm!r}\n".encode(), ("127.0.0.1", port))
                found.append(tuple(map(float, udp.recv(4096).decode().split(",")))[1:])
    assert found == expected


def test_lab_streaming_layer(folder, rows, expected):
    pylsl = needed("pylsl")
    name = f"resistance-{os.getpid()}"
    about = pylsl.StreamInfo(name, "resistance", 1, pylsl.IRREGULAR_RATE, pylsl.cf_double64, name)
    outlet = pylsl.StreamOutlet(about)
    with running("lsl.py", folder / "sensor.toml", name, f"strain-{os.getpid()}", says="looking"):
        found = pylsl.resolve_byprop("name", f"strain-{os.getpid()}", timeout=PATIENCE)
        if not found:
            pytest.skip("no stream is found: this machine lets no multicast through")
        inlet = pylsl.StreamInlet(found[0])
        inlet.open_stream(timeout=PATIENCE)
        assert outlet.wait_for_consumers(PATIENCE)
        begin, samples = pylsl.local_clock(), []
        for time_ns, ohm in rows:
            outlet.push_sample([ohm], begin + time_ns / 1e9)
            samples.append(inlet.pull_sample(timeout=PATIENCE))
    # The stamps pass through a clock's correction and a smoothing: microseconds, on one machine.
    strains = np.array([sample for sample, _ in samples])
    np.testing.assert_allclose(strains, expected, rtol=1e-2, atol=1e-4)
    np.testing.assert_allclose([stamp - begin for _, stamp in samples], [time_ns / 1e9 for time_ns, _ in rows], atol=1e-3)


def write_ros2(path, rows, plugin="MCAP"):
    """A ROS 2 bag with a topic of readings, and one of texts."""
    rosbag2, typesys = needed("rosbags.rosbag2"), needed("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin]) as writer:
        readings = writer.add_connection("/resistance_ohm", "std_msgs/msg/Float64", typestore=store)
        texts = writer.add_connection("/said", "std_msgs/msg/String", typestore=store)
        for time_ns, ohm in rows:
            message = store.types["std_msgs/msg/Float64"](ohm)
            writer.write(readings, BEGIN + time_ns, store.serialize_cdr(message, "std_msgs/msg/Float64"))
            text = store.types["std_msgs/msg/String"]("on")
            writer.write(texts, BEGIN + time_ns, store.serialize_cdr(text, "std_msgs/msg/String"))
    return path


def write_ros1(path, rows):
    """A ROS 1 bag with a topic of readings."""
    rosbag1, typesys = needed("rosbags.rosbag1"), needed("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as writer:
        readings = writer.add_connection("/resistance_ohm", "std_msgs/msg/Float64", typestore=store)
        for time_ns, ohm in rows:
            message = store.types["std_msgs/msg/Float64"](ohm)
            writer.write(readings, BEGIN + time_ns, store.serialize_ros1(message, "std_msgs/msg/Float64"))
    return path


#: The first row of a bag, ns since 1970.
BEGIN = 1_761_935_745_123_456_789


@pytest.mark.parametrize("kind", ["ros1", "SQLITE3", "MCAP"])
def test_ros_bags(folder, rows, expected, tmp_path, kind):
    highlevel = needed("rosbags.highlevel")
    bag = write_ros1(tmp_path / "in.bag", rows) if kind == "ros1" else write_ros2(tmp_path / "in", rows, kind)
    done("ros_bag.py", folder / "sensor.toml", bag, "/resistance_ohm", tmp_path / "out")
    found = {"/strain": [], "/strain_sd": []}
    with highlevel.AnyReader([tmp_path / "out"]) as reader:
        for connection, time_ns, data in reader.messages():
            found[connection.topic].append((time_ns - BEGIN, reader.deserialize(data, connection.msgtype).data))
    times = [time_ns for time_ns, _ in rows]
    assert found["/strain"] == list(zip(times, [strain for strain, _ in expected]))
    assert found["/strain_sd"] == list(zip(times, [sd for _, sd in expected]))


def test_mcap(folder, rows, expected, tmp_path):
    reader, decoder = needed("mcap.reader"), needed("mcap_ros2.decoder")
    [file] = write_ros2(tmp_path / "in", rows).glob("*.mcap")
    done("mcap_file.py", folder / "sensor.toml", file, "/resistance_ohm", tmp_path / "out.mcap")
    found = {"/strain": [], "/strain_sd": []}
    with open(tmp_path / "out.mcap", "rb") as out:
        for message in reader.make_reader(out, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages():
            found[message.channel.topic].append(message.decoded_message.data)
    assert list(zip(found["/strain"], found["/strain_sd"])) == expected


def test_ros2_topic_without_ros(folder, rows):
    """Values are those of the times at which they came, so that only their range is known."""
    needed("cyclonedds")
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    tree = ast.parse((EXAMPLES / "ros2_topic.py").read_text(encoding="utf-8"))
    assert "std_msgs::msg::dds_::Float64_" in ast.unparse(tree)
    from dataclasses import dataclass

    from cyclonedds.idl import IdlStruct
    from cyclonedds.idl.types import float64

    @dataclass
    class Number(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
        data: float64

    domain = 100 + os.getpid() % 100
    participant = DomainParticipant(domain)
    writer = DataWriter(participant, Topic(participant, "rt/resistance", Number))
    strain = DataReader(participant, Topic(participant, "rt/strain", Number))
    with running("ros2_topic.py", folder / "sensor.toml", says="waiting", ROS_DOMAIN_ID=str(domain)):
        started, found = time.monotonic(), []
        while len(found) < 10 and time.monotonic() - started < PATIENCE:
            writer.write(Number(rows[len(found)][1]))
            time.sleep(0.1)
            found.extend(sample.data for sample in strain.take(20))
    assert len(found) >= 10 and all(-0.1 < value < 0.5 for value in found), found


def test_ros2_node_is_reported_as_not_run():
    text = (EXAMPLES / "ros2_node.py").read_text(encoding="utf-8")
    compile(text, "ros2_node.py", "exec")
    assert "Not run by this project's tests" in ast.get_docstring(ast.parse(text))


def test_foxglove(folder, rows, expected):
    needed("foxglove")
    client = needed("websockets.sync.client")
    port = free_port()
    with running("foxglove_live.py", folder / "sensor.toml", says="Foxglove", PORT=str(port)) as example:
        with client.connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], open_timeout=PATIENCE) as socket_:
            channel = None
            while channel is None:
                message = socket_.recv(timeout=PATIENCE)
                parsed = json.loads(message) if isinstance(message, str) else {}
                channel = next((c for c in parsed.get("channels", ()) if c["topic"] == "/strain"), None)
            assert channel["encoding"] == "json" and "lower" in channel["schema"]
            socket_.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel["id"]}]}))
            found = []
            # What is logged before the subscription has arrived is not sent: the first row is repeated until one comes.
            for time_ns, ohm in rows:
                example.stdin.write(f"{time_ns / 1e9!r},{ohm!r}\n")
                example.stdin.flush()
                try:
                    message = socket_.recv(timeout=PATIENCE if found else 2)
                except TimeoutError:
                    continue
                # An opcode, the subscription and the time stand before the message.
                found.append(json.loads(message[13:]))
    assert len(found) > len(rows) // 2
    of_time = dict(zip([time_ns / 1e9 for time_ns, _ in rows], expected))
    for row in found:
        strain, sd = of_time[row["time_s"]]
        assert (row["strain"], row["lower"]) == (strain, strain - 1.96 * sd)


def test_cross_validation(tmp_path):
    pytest.importorskip("sklearn")
    names = [f"{day}.csv" for day in ("monday", "tuesday", "wednesday")]
    for seed, name in enumerate(names):
        run(tmp_path, "simulate", "--protocol", "mixed", "--speed-mm-s", "5", "--sample-rate-hz", "2", "--seed", str(seed), "-o", name)
    lines = done("cross_validation.py", *(tmp_path / name for name in names)).splitlines()
    tables = [oh.read(tmp_path / name) for name in names]
    span = np.ptp(np.concatenate([table["strain"].to_numpy() for table in tables]))
    for k, line in enumerate(lines):
        sensor = oh.calibrate([table for j, table in enumerate(tables) if j != k], estimator="ekf")
        off = sensor.smooth(tables[k])["strain"].to_numpy() - tables[k]["strain"].to_numpy()
        assert f"{names[k]} left out: RMSE {100 * np.sqrt(np.mean(off**2)) / span:.2f} %FS, R2 " in line
    assert len(lines) == 3
