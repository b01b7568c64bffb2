"""ROS bags, without ROS: a topic of readings in, a bag with the strain out.

    pip install rosbags
    python ros_bag.py sensor.toml recorded /resistance estimated

`recorded` is a ROS 2 bag (a folder) or a ROS 1 bag (a file). Its topic has messages std_msgs/Float64. `estimated` is a ROS 2 bag with
/strain and /strain_sd, at the times of the readings: `ros2 bag play estimated`.
"""

import sys
from pathlib import Path

import ohmstrain as oh
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

FLOAT = "std_msgs/msg/Float64"


def main(sensor_file, bag, topic, out):
    live = oh.Sensor.load(sensor_file).filter()
    store = get_typestore(Stores.ROS2_HUMBLE)
    float64 = store.types[FLOAT]
    with AnyReader([Path(bag)], default_typestore=store) as reader, Writer(Path(out), version=9) as writer:
        wanted = [connection for connection in reader.connections if connection.topic == topic]
        if not wanted:
            sys.exit(f"{bag}: no topic {topic}, but {', '.join(sorted(reader.topics))}")
        outputs = {name: writer.add_connection(f"/{name}", FLOAT, typestore=store) for name in ("strain", "strain_sd")}
        for connection, time_ns, data in reader.messages(connections=wanted):
            reading = reader.deserialize(data, connection.msgtype).data
            row = live.step((time_ns - reader.start_time) / 1e9, reading)
            for name, output in outputs.items():
                writer.write(output, time_ns, store.serialize_cdr(float64(row[name]), FLOAT))


if __name__ == "__main__":
    main(*sys.argv[1:])
