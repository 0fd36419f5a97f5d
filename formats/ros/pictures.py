"""The pictures of ROS and what their camera says of itself, out of a message body."""

from __future__ import annotations

from formats.messages import CameraInfo, CompressedImage, Image
from formats.payload import Payload, Undecodable
from formats.ros.wire import Body, Wire


def image(wire: Wire, data: Payload) -> Image:
    """sensor_msgs/Image."""
    body = Body(wire, data)
    stamp, frame = body.header()
    height, width = body.read("2I")
    encoding = body.text()
    (big,) = body.read("B")
    (step,) = body.read("I")
    pixels = body.array("u1", "bytes of pixels")
    body.end()
    if height * step > len(pixels):
        raise Undecodable("too few pixels", f"{len(pixels)} bytes for {height} rows of {step}")
    return Image(stamp, frame, height, width, encoding, bool(big), step, pixels[: height * step])


def compressed_image(wire: Wire, data: Payload) -> CompressedImage:
    """sensor_msgs/CompressedImage."""
    body = Body(wire, data)
    stamp, frame = body.header()
    form = body.text()
    content = body.array("u1", "bytes of picture")
    body.end()
    return CompressedImage(stamp, frame, form, content)


def camera_info(wire: Wire, data: Payload) -> CameraInfo:
    """sensor_msgs/CameraInfo; R and P are passed over."""
    body = Body(wire, data)
    stamp, frame = body.header()
    height, width = body.read("2I")
    model = body.text()
    d = body.array("f8", "distortion numbers")
    k = body.array("f8", "camera matrix numbers", 9).reshape(3, 3)
    body.read("21d")
    across, down, x, y, rows, cols = body.read("6I")
    body.read("B")
    body.end()
    part = (x, y, cols, rows)
    return CameraInfo(stamp, frame, height, width, model, d, k, (across, down), part)
