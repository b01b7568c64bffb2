"""MCAP: a topic of readings in, a file with the strain out.

    pip install mcap mcap-ros2-support
    python mcap_file.py sensor.toml recorded.mcap /resistance estimated.mcap

The topic has messages std_msgs/msg/Float64 of ROS 2. The file that is written has /strain and /strain_sd, at the times of the readings;
Foxglove and `ros2 bag play` open it.
"""

import sys

import ohmstrain as oh
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer


def main(sensor_file, path, topic, out):
    live = oh.Sensor.load(sensor_file).filter()
    with open(path, "rb") as source, open(out, "wb") as target:
        writer = Writer(target)
        float64 = writer.register_msgdef("std_msgs/msg/Float64", "float64 data")
        begin = None
        reader = make_reader(source, decoder_factories=[DecoderFactory()])
        for number, (_, _, message, decoded) in enumerate(reader.iter_decoded_messages(topics=[topic])):
            begin = message.log_time if begin is None else begin
            row = live.step((message.log_time - begin) / 1e9, decoded.data)
            for name in ("strain", "strain_sd"):
                writer.write_message(f"/{name}", float64, {"data": row[name]}, message.log_time, message.log_time, number)
        writer.finish()
    if begin is None:
        sys.exit(f"{path}: no message in the topic {topic}")


if __name__ == "__main__":
    main(*sys.argv[1:])
