"""A ROS 2 node of a head: service `trigger`; topics `points`, `sigma` and `verdict`. Lengths in m, as ROS has them.

    python3 ros2_node.py --ros-args -p url:=http://10.20.1.11 -p secret:=7K2QF-90HXT-M4WZB-E8N1C
"""

from __future__ import annotations

import numpy
import rclpy
from sensor_msgs.msg import Image, PointCloud2
from sensor_msgs_py.point_cloud2 import create_cloud_xyz32
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

from fringed import FringedError, Head, Maps

MM_PER_M = numpy.float32(1000)


def image(maps: Maps, header: Header) -> Image:
    """The uncertainty (1 sigma) of z of each pixel, NaN where not measured."""
    height, width = maps.sigma.shape
    return Image(header=header, height=height, width=width, encoding="32FC1", step=4 * width,
                 data=(maps.sigma / MM_PER_M).tobytes())


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("fringed")
    defaults = {"url": "http://10.20.1.11", "secret": "", "frame_id": "head"}
    url, secret, frame_id = (node.declare_parameter(name, value).value for name, value in defaults.items())
    head = Head(url, secret)
    points = node.create_publisher(PointCloud2, "points", 1)
    sigma = node.create_publisher(Image, "sigma", 1)
    verdict = node.create_publisher(String, "verdict", 1)

    def trigger(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        header = Header(stamp=node.get_clock().now().to_msg(), frame_id=frame_id)
        try:
            result = head.trigger()
            verdict.publish(String(data=result.verdict))
            points.publish(create_cloud_xyz32(header, result.maps.points() / MM_PER_M))
            sigma.publish(image(result.maps, header))
            response.success, response.message = True, result.verdict
        except FringedError as error:
            response.success, response.message = False, str(error)
        return response

    node.create_service(Trigger, "trigger", trigger)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
