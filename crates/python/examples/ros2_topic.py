"""Topics of ROS 2, without ROS: readings in, strain out, by DDS.

    pip install cyclonedds
    python ros2_topic.py sensor.toml

ROS 2 calls the topic /resistance `rt/resistance` on the wire, and std_msgs/msg/Float64 `std_msgs::msg::dds_::Float64_`. A node on the
same network with the same ROS_DOMAIN_ID publishes the one and echoes the other: `ros2 topic echo /strain`.
"""

import os
import sys
import time
from dataclasses import dataclass

import ohmstrain as oh
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic


@dataclass
class Float64_(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
    data: float64


def main(sensor_file):
    live = oh.Sensor.load(sensor_file).filter()
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", "0")))
    readings = DataReader(participant, Topic(participant, "rt/resistance", Float64_))
    outputs = {name: DataWriter(participant, Topic(participant, f"rt/{name}", Float64_)) for name in ("strain", "strain_sd")}
    print("waiting for /resistance", flush=True)
    begin = time.monotonic()
    for reading in readings.take_iter():
        # Float64 has no stamp: the time of arrival is the reading's.
        row = live.step(time.monotonic() - begin, reading.data)
        for name, output in outputs.items():
            output.write(Float64_(row[name]))


if __name__ == "__main__":
    main(*sys.argv[1:])
