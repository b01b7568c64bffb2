"""A node of ROS 2: readings in, strain out. Written for Humble and later.

    python ros2_node.py --ros-args -p sensor:=sensor.toml -r resistance:=/glove/resistance

Not run by this project's tests: rclpy comes with ROS 2 and has no wheel. What it exchanges is that of ros2_topic.py, which the tests run.
It subscribes to `resistance` and publishes `strain` and `strain_sd`, all std_msgs/msg/Float64.
"""

import ohmstrain as oh
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64


class StrainNode(Node):
    def __init__(self):
        super().__init__("ohmstrain")
        self.declare_parameter("sensor", "sensor.toml")
        self.live = oh.Sensor.load(self.get_parameter("sensor").value).filter()
        self.outputs = {name: self.create_publisher(Float64, name, 10) for name in ("strain", "strain_sd")}
        self.create_subscription(Float64, "resistance", self.on_reading, qos_profile_sensor_data)
        self.begin = self.get_clock().now()

    def on_reading(self, message):
        time_s = (self.get_clock().now() - self.begin).nanoseconds / 1e9
        try:
            row = self.live.step(time_s, message.data)
        except oh.OhmstrainError as error:
            self.get_logger().warning(str(error))
            return
        for name, output in self.outputs.items():
            output.publish(Float64(data=row[name]))


def main():
    rclpy.init()
    try:
        rclpy.spin(StrainNode())
    except KeyboardInterrupt:
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
