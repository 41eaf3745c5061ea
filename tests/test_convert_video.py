"""`copolicy-convert mcap --video`: the right image for every frame, in any file."""

import io
import json
import logging
import shutil
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from checked_data import contents, make_data_set, make_recordings
from lerobot.datasets import LeRobotDataset, dataset_reader
from lerobot.datasets.compute_stats import compute_episode_stats
from PIL import Image
from video_difference import video_difference

from copolicy.convert.cli import main
from copolicy.convert.lerobot.prepare import Conversion, prepare_episode
from copolicy.convert.lerobot.writer import write_dataset
from copolicy.convert.video import scene_video
from copolicy.convert.video.scene_video import SCENE, parse_size, scene_clip, scene_encoder
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import STATE
from copolicy.dataset.lerobot_folder.exclusions import exclude, excluded_episodes
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.versions.content import read_content
from copolicy.tasks.table import TableTask
from copolicy.tasks.table.artist.scene_image import SceneImage
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.train.cli import main as train

SIZE = (160, 80)
FLAGS = ("--no-drift", "--video", "--video-size", "160x80")


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> Path:
    """Recordings in `raw/a` and `raw/b`; `a` and `b` of them, and `both`."""
    folder = tmp_path_factory.mktemp("video")
    for name, seed in (("a", 1), ("b", 2)):
        make_recordings(folder / "raw" / name, 2, seed=seed)
        make_data_set(folder / "raw" / name, folder / name, *FLAGS)
    make_data_set(folder / "raw", folder / "both", *FLAGS)
    return folder


@pytest.fixture
def root(folders, tmp_path) -> Path:
    return Path(shutil.copytree(folders / "a", tmp_path / "a"))


@pytest.fixture(autouse=True)
def _restored_logging():
    """LeRobot replaces the handlers of the root logger."""
    logger = logging.getLogger()
    before = logger.handlers[:], logger.level
    yield
    logger.handlers[:], logger.level = before


def load(root: Path, **options) -> Any:
    # torchcodec, LeRobot's first choice, needs ffmpeg's libraries on the machine; PyAV brings its own.
    return LeRobotDataset("lab/table", root=root, video_backend="pyav", **options)


def drawn(raw: Path) -> list[np.ndarray]:
    """For each recording the images of its frames at 10 Hz, `(T, 80, 160, 3)`."""
    episodes = [read_episode(path) for path in sorted(raw.rglob("*.mcap"))]
    return [
        np.stack(list(TableTask().images(episode.map_config, episode.states[::3].astype(np.float32), SIZE)))
        for episode in episodes
    ]


def decoded(dataset: Any, index: int) -> np.ndarray:
    return dataset[index][SCENE].numpy().transpose(1, 2, 0) * 255


def assert_images(dataset: Any, expected: list[np.ndarray]) -> None:
    """The first, second, a middle and the last frame of each episode show the expected image."""
    rows = dataset.meta.episodes
    assert len(rows) == len(expected)
    for start, end, images in zip(rows["dataset_from_index"], rows["dataset_to_index"], expected, strict=True):
        assert end - start == len(images)
        for frame in (0, 1, len(images) // 2, len(images) - 1):
            shown = decoded(dataset, start + frame)
            distances = np.abs(images - shown).mean(axis=(1, 2, 3))
            assert distances[frame] < 4  # levels of 255: lossy, and colour at half the resolution
            # The table hardly moves from one frame to the next, least of all at the start.
            assert distances[frame] <= distances.min() + 0.02


def test_every_index_gives_its_own_image(folders):
    dataset = load(folders / "both")
    images = drawn(folders / "raw")
    assert_images(dataset, images)
    # Where one episode ends and the next begins, on another map.
    boundary = dataset.meta.episodes["dataset_from_index"][1]
    shown = decoded(dataset, boundary)
    assert np.abs(shown - images[1][0]).mean() < np.abs(shown - images[0][0]).mean() - 1
    assert np.abs(decoded(dataset, boundary - 1) - images[0][-1]).mean() < 4


def test_the_metadata_are_those_of_lerobots_own_videos(folders):
    root = folders / "both"
    dataset = load(root)
    feature = dataset.meta.features[SCENE]
    assert (feature["dtype"], feature["shape"]) == ("video", (80, 160, 3))
    assert feature["names"] == ["height", "width", "channels"]
    info = feature["info"]
    assert (info["video.codec"], info["video.pix_fmt"], info["video.fps"]) == ("h264", "yuv420p", 10)
    assert info["is_depth_map"] is False
    rows = dataset.meta.episodes
    lengths = np.array(rows["length"])
    assert rows[f"videos/{SCENE}/chunk_index"] == rows[f"videos/{SCENE}/file_index"] == [0] * 4
    np.testing.assert_allclose(rows[f"videos/{SCENE}/to_timestamp"], np.cumsum(lengths) / 10)
    np.testing.assert_allclose(rows[f"videos/{SCENE}/from_timestamp"], (np.cumsum(lengths) - lengths) / 10)
    with av.open(str(root / "videos" / SCENE / "chunk-000" / "file-000.mp4")) as container:
        stream = container.streams.video[0]
        assert stream.frames == lengths.sum()
        assert stream.average_rate == 10
    assert [finding for finding in check_dataset(root).findings if finding.severity == "error"] == []


def test_statistics_are_lerobots_of_the_same_images(folders, tmp_path):
    episode = read_episode(min((folders / "raw").rglob("*.mcap")))
    images = list(TableTask().images(episode.map_config, episode.states[:300:30], (600, 300)))
    computed = scene_clip(images, 10, (600, 300)).statistics
    paths = [str(tmp_path / f"{index}.png") for index in range(len(images))]
    for path, image in zip(paths, images, strict=True):
        Image.fromarray(image).save(path)
    reference = compute_episode_stats({SCENE: paths}, {SCENE: {"dtype": "video", "shape": (300, 600, 3)}})[SCENE]
    assert computed.keys() == reference.keys()
    for statistic, value in computed.items():
        assert value.shape == reference[statistic].shape
        if statistic not in ("mean", "std"):  # LeRobot adds a hundred thousand pixels in single precision: 15 % off
            np.testing.assert_allclose(value, reference[statistic], atol=1e-3, err_msg=statistic)
    pixels = np.stack(images)[:, ::4, ::4].reshape(-1, 3) / 255
    np.testing.assert_allclose(computed["mean"].ravel(), pixels.mean(axis=0))
    np.testing.assert_allclose(computed["std"].ravel(), pixels.std(axis=0))


def test_files_change_when_they_are_full(folders, tmp_path):
    paths = sorted((folders / "raw").rglob("*.mcap"))
    conversion = Conversion(drift=False, video=SIZE)
    prepared = [prepare_episode(read_episode(path), conversion) for path in paths]
    write_dataset(prepared, tmp_path / "set", "lab/table", 10, "mean", dict, video_file_mb=1e-6)  # pyright: ignore
    dataset = load(tmp_path / "set")
    assert dataset.meta.episodes[f"videos/{SCENE}/file_index"] == [0, 1, 2, 3]
    assert dataset.meta.episodes[f"videos/{SCENE}/from_timestamp"] == [0] * 4
    assert_images(dataset, drawn(folders / "raw"))
    together = read_content(folders / "both")
    assert [episode.features for episode in read_content(tmp_path / "set").episodes] == [
        episode.features for episode in together.episodes
    ]


def test_the_content_does_not_depend_on_other_episodes_of_the_file(folders):
    digests = [episode.digest for name in "ab" for episode in read_content(folders / name).episodes]
    assert len(set(digests)) == 4
    changed = [episode.features[SCENE] for episode in read_content(folders / "both").episodes]
    assert changed == [episode.features[SCENE] for name in "ab" for episode in read_content(folders / name).episodes]


def append(folder: Path, root: Path, *flags: str) -> int:
    arguments = ["mcap", str(folder), "--out", str(root), "--repo-id", "lab/table", "--license", "cc-by-4.0"]
    return main([*arguments, "--append", "--no-drift", *flags])


def test_appending_adds_a_file_with_the_same_size(folders, root, capsys):
    before = contents(root)
    assert append(folders / "raw" / "b", root) == 0
    dataset = load(root)
    assert dataset.meta.episodes[f"videos/{SCENE}/file_index"] == [0, 0, 1, 1]
    assert_images(dataset, drawn(folders / "raw"))
    appended, expected = read_content(root), read_content(folders / "both")
    for episode, expected_episode in zip(appended.episodes, expected.episodes, strict=True):
        same_content = (episode.features, episode.columns) == (expected_episode.features, expected_episode.columns)
        assert same_content, video_difference(root, folders / "both")
    assert appended.features == expected.features
    assert appended.hash == expected.hash
    first = f"videos/{SCENE}/chunk-000/file-000.mp4"
    assert contents(root)[first] == before[first]
    exclude(root, ["3"], "withdrawn")
    assert [entry.episode for entry in excluded_episodes(root)] == [3]
    assert_images(load(root), drawn(folders / "raw"))


def test_another_size_or_a_video_where_there_is_none_is_refused(folders, root, tmp_path, capsys):
    before = contents(root)
    assert append(folders / "raw" / "b", root, "--video", "--video-size", "320x160") == 2
    plain = make_data_set(folders / "raw" / "a", tmp_path / "plain", "--no-drift")
    assert append(folders / "raw" / "b", plain, "--video") == 2
    assert append(folders / "raw" / "b", plain, "--video-size", "160x80") == 2
    assert capsys.readouterr().err.splitlines() == [
        f"copolicy-convert: --video-size: expected 160x80, as {root} has it, found '320x160'",
        f"copolicy-convert: --video: expected none, as {plain} has no video, found 'one'",
        "copolicy-convert: --video-size: expected --video beside it, found '160x80'",
    ]
    assert contents(root) == before


def test_merging_gives_what_one_conversion_gives(folders, tmp_path, capsys):
    arguments = ["merge", str(folders / "a"), str(folders / "b"), "--out", str(tmp_path / "m"), "--repo-id", "lab/both"]
    assert main([*arguments, "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert json.loads(captured.out)["content_hash"] == read_content(folders / "both").hash
    assert_images(load(tmp_path / "m"), drawn(folders / "raw"))


@pytest.mark.parametrize("text", ["600", "601x300", "32x32", "600x", "axb", "600x300x3", "8000x4000"])
def test_a_size_that_no_encoder_takes_is_refused(text):
    expected = f"--video-size: expected WIDTHxHEIGHT in even px from 64 to 3840, found {text!r}"
    with pytest.raises(InvalidValueError) as error:
        parse_size(text)
    assert str(error.value) == expected
    assert parse_size("600x300") == (600, 300)


def test_an_image_shows_no_forces(folders):
    recording = read_episode(min((folders / "raw" / "a").glob("*.mcap")))
    state = recording.states[:1]
    config = MAP_SETS["training"][0]
    (image,) = TableTask().images(config, state, SIZE)
    (repeated,) = TableTask().images(config, state, SIZE)
    assert image.shape == (80, 160, 3)
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, repeated)
    (tall,) = TableTask().images(config, state, (160, 160))
    np.testing.assert_array_equal(tall[40:120], image)
    assert not tall[:40].any()


def test_training_opens_no_video(folders, tmp_path, monkeypatch, capsys):
    def decode(*arguments, **options):
        raise AssertionError("a video was decoded")

    monkeypatch.setattr(dataset_reader, "decode_video_frames", decode)
    small = ["--policy.preset=small", "--policy.width=16", "--policy.n_layers=1", "--policy.device=cpu"]
    out = tmp_path / "out"
    flags = [f"--dataset.root={folders / 'a'}", f"--output_dir={out}", "--steps=2", "--batch_size=8", *small]
    assert train(flags) == 0
    error = capsys.readouterr().err
    assert f"The policy does not observe {SCENE}: no video is decoded" in error
    assert "LeRobot's own loader" not in error
    assert (out / "checkpoints" / "last" / "pretrained_model" / "model.safetensors").is_file()
    with pytest.raises(AssertionError, match="a video was decoded"):  # what the check would have seen
        load(folders / "a")[0]
    assert (
        STATE
        in json.loads((out / "checkpoints/last/pretrained_model/config.json").read_text(encoding="utf-8"))[
            "input_features"
        ]
    )


def test_a_difference_of_videos_is_reported(folders):
    assert video_difference(folders / "both", folders / "both") == ""
    lines = video_difference(folders / "a", folders / "b").splitlines()
    assert [line.split(":")[0] for line in lines] == [f"episode {number}, {SCENE}" for number in range(2)]
    assert "images by up to" in lines[0]


def test_the_bytes_do_not_depend_on_the_instructions_of_the_processor(monkeypatch):
    image = SceneImage(MAP_SETS["training"][30], SIZE)
    images = [image.draw((150.0 + 7 * step, 300.0 - 3 * step, 0.1 * step)) for step in range(30)]

    def encoded(instructions: str) -> bytes:
        encoder = scene_encoder(10)
        encoder.extra_options["x264-params"] += f":asm={instructions}"
        monkeypatch.setattr(scene_video, "scene_encoder", lambda fps: encoder)
        return scene_clip(images, 10, SIZE).mp4

    plain = encoded("0")
    assert encoded("sse2") == encoded("ssse3") == encoded("avx2") == plain


@pytest.mark.parametrize(
    ("colour", "ycc"),
    [((0, 0, 0), (16, 128, 128)), ((255, 255, 255), (235, 128, 128)), ((255, 0, 0), (81, 90, 240)),
     ((0, 255, 0), (145, 54, 34)), ((0, 0, 255), (41, 240, 110))],
)  # fmt: skip
def test_colours_are_those_of_bt_601(colour, ycc):
    mp4 = scene_clip([np.full((80, 160, 3), colour, np.uint8)] * 2, 10, SIZE).mp4
    with av.open(io.BytesIO(mp4), "r") as film:
        frame = next(film.decode(video=0)).to_ndarray(format="yuv420p")
        planes = frame[:80], frame[80:100], frame[100:]
        assert tuple(int(np.median(plane)) for plane in planes) == pytest.approx(ycc, abs=1)
