"""Describes the difference of two data sets that should hold the same encoded videos."""

from pathlib import Path

import av
import numpy as np

from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.lerobot_folder.references import video_features, video_span


def video_difference(actual: Path, expected: Path) -> str:
    """A line for each episode whose video has other bytes: which packets, and by how much the images differ.

    Packets that differ from some packet on, with images that hardly differ, are the encoder's; images that differ where
    nothing moves are the drawing's.
    """
    first, second = LeRobotFolder.open(actual), LeRobotFolder.open(expected)
    lines = []
    for row, expected_row in zip(first.episodes.to_pylist(), second.episodes.to_pylist(), strict=True):
        for key in video_features(first.info):
            packets, images = _clip(first, row, key)
            expected_packets, expected_images = _clip(second, expected_row, key)
            pairs = zip(packets, expected_packets, strict=False)
            differ = [index for index, (packet, expected_packet) in enumerate(pairs) if packet != expected_packet]
            if not differ and len(packets) == len(expected_packets):
                continue
            distances = [np.abs(a - b).max() for a, b in zip(images, expected_images, strict=False)]
            sizes = [(len(packets[index]), len(expected_packets[index])) for index in differ[:3]]
            lines.append(
                f"episode {row['episode_index']}, {key}: {len(differ)} of {len(packets)} packets differ "
                f"({len(expected_packets)} expected), the first {differ[:3]} of {sizes} bytes; images by up to "
                f"{max(distances)} of 255 levels, the first at {int(np.argmax(np.array(distances) > 0))}"
            )
    return "\n".join(lines)


def _clip(folder: LeRobotFolder, row: dict, key: str) -> tuple[list[bytes], list[np.ndarray]]:
    """The packets of an episode, and its images as `(height, width, 3)` int."""
    path, start, end = video_span(folder.root, folder.info, row, key)
    half = 0.5 / folder.info["fps"]

    def inside(time: float | None) -> bool:
        return time is not None and start - half <= time < end - half

    packets: list[bytes] = []
    images: list[np.ndarray] = []
    with av.open(str(path)) as container:
        for packet in container.demux(container.streams.video[0]):
            if packet.pts is None or packet.time_base is None:
                continue
            if packet.size and inside(float(packet.pts * packet.time_base)):
                packets.append(bytes(packet))
    with av.open(str(path)) as container:
        images += [
            frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0) if inside(frame.time)
        ]
    return packets, images
