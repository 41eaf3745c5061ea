from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.versions.frame_digests import video_digest

FPS = 10


def encode(path: Path, seed: int, frames: int) -> Path:
    random = np.random.default_rng(seed)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=FPS)
        stream.width = stream.height = 32
        stream.time_base = Fraction(1, FPS)
        for _ in range(frames):
            picture = av.VideoFrame.from_ndarray(random.integers(0, 255, (32, 32, 3), np.uint8), format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def join(path: Path, parts: list[Path]) -> Path:
    """Joins files without encoding again, as LeRobot joins the videos of episodes."""
    with av.open(str(path), "w") as container, av.open(str(parts[0])) as first:
        stream = container.add_stream_from_template(first.streams.video[0])
        offset = 0
        for part in parts:
            with av.open(str(part)) as source:
                packets = [packet for packet in source.demux(source.streams.video[0]) if packet.size]
                length = sum(packet.duration or 0 for packet in packets)
                for packet in packets:
                    assert packet.pts is not None
                    packet.pts += offset
                    packet.dts = packet.pts
                    packet.stream = stream
                    container.mux(packet)
                offset += length
    return path


def test_joining_videos_keeps_the_digest(tmp_path):
    one, two = encode(tmp_path / "one.mp4", 1, 12), encode(tmp_path / "two.mp4", 2, 7)
    joined = join(tmp_path / "joined.mp4", [one, two])
    assert video_digest(joined, 0, 1.2, FPS) == video_digest(one, 0, 1.2, FPS)
    assert video_digest(joined, 1.2, 1.9, FPS) == video_digest(two, 0, 0.7, FPS)
    assert video_digest(one, 0, 1.2, FPS) != video_digest(two, 0, 0.7, FPS)
    assert video_digest(one, 0, 1.1, FPS) != video_digest(one, 0, 1.2, FPS)


def test_a_replaced_file_has_a_new_digest(tmp_path):
    path, other = encode(tmp_path / "one.mp4", 1, 12), encode(tmp_path / "two.mp4", 2, 12)
    before, expected = (video_digest(file, 0, 1.2, FPS) for file in (path, other))
    other.replace(path)
    assert video_digest(path, 0, 1.2, FPS) == expected != before


def test_a_file_that_is_not_a_video_is_refused(tmp_path):
    (tmp_path / "x.mp4").write_bytes(b"no video")
    with pytest.raises(FileFormatError, match=r"x.mp4: expected a video, found"):
        video_digest(tmp_path / "x.mp4", 0, 1, FPS)
