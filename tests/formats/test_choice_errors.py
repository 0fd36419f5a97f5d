"""What is said where nothing can be chosen."""

from __future__ import annotations

from pathlib import Path

import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.log import Message, Topic
from formats.stream import Options, open_log, survey
from tests.memory_log import MemoryLog
from tests.parts import (
    Add,
    drive,
    mount,
    odom,
    opened,
    scans,
    second_scan,
    truth,
)
from tests.ros_logs import RosLog

ERRORS: list[tuple[list[Add], Options, int, str]] = [
    ([odom], {}, 1, "no scans: looked for LaserScan"),
    ([scans], {}, 1, "/scan: no pose source: looked for tf .* found none of these; .*--pose"),
    ([scans, second_scan], {}, 1, "no pose source: looked for tf .* found none of these"),
    ([scans, mount], {}, 1, "/scan: no pose source: .* found /tf_static .*base_link > laser"),
    (
        [scans, odom],
        {},
        1,
        r"/scan: no transform base_link <- laser at 0.00 s \(30 of 30 scans\); "
        "give --sensor-pose X,Y,YAW or record /tf_static",
    ),
    ([scans, truth], {}, 1, "no transform base_link <- laser .*--sensor-pose"),
    ([scans, mount, odom], {"scan": "/none"}, 2, r"/none: no such topic; scans here: /scan"),
    ([scans, mount, odom], {"scan": "/tf"}, 2, "/tf: tf2_msgs/msg/TFMessage is not a scan"),
    ([scans, mount, odom], {"pose": "/none"}, 2, "/none: no such topic; poses here: none, or tf"),
    ([scans, mount, odom], {"pose": "/scan"}, 2, "sensor_msgs/msg/LaserScan has no poses"),
    ([scans, mount, odom], {"map_frame": "mapp"}, 2, "no frame mapp .* frames: base_link, laser"),
    ([scans, mount, odom], {"base_frame": "bass"}, 2, "no frame bass .* frames: base_link, laser"),
]


@pytest.mark.parametrize(("adds", "options", "code", "text"), ERRORS)
def test_errors_say_what_was_looked_for_and_what_to_do(
    adds: list[Add], options: Options, code: int, text: str
) -> None:
    with pytest.raises(FormatError, match=text) as caught:
        opened(drive(*adds), **options)
    assert caught.value.exit_code == code
    assert "\n" not in str(caught.value)


def test_no_messages_is_said() -> None:
    with pytest.raises(FormatError, match="no messages"):
        opened(RosLog())


def test_a_scan_in_an_encoding_that_nothing_reads_is_said() -> None:
    topic = Topic("/scan", "sensor_msgs/msg/LaserScan", "cbor", count=1)
    log = MemoryLog([Message(topic, 1, b"")])
    with pytest.raises(FormatError, match="/scan as cbor cannot be decoded"):
        survey(log, Notes())


@pytest.mark.parametrize("options", [{}, {"scan": "/scan"}])
def test_one_topic_in_two_encodings_is_not_mapped_by_half(tmp_path: Path, options: Options) -> None:
    log = drive(scans, mount, odom)
    paths = [log.write(tmp_path / "a.bag"), log.write(tmp_path / "b.mcap")]
    with pytest.raises(UsageError, match="recorded as cdr and ros1, by several logs"):
        survey(open_log(paths, Notes()), Notes(), **options)
