"""Describes unexpected files and folders in error messages, with the command that reads them."""

import stat
import zipfile
from pathlib import Path

from ..exceptions import CopolicyError
from .listing import visible_files
from .meta_files import INFO_FILE

_HEAD = 512  # bytes read to identify a file
_MAGIC: tuple[tuple[bytes, str], ...] = (
    (b"\x89MCAP0\r\n", "an MCAP file"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"\x93NUMPY", "a NumPy array (.npy)"),
    (b"PAR1", "a Parquet file"),
    (b"ARROW1", "an Arrow file"),
    (b"#ROSBAG V", "a ROS 1 bag"),
    (b"SQLite format 3\0", "an SQLite database, as rosbag2 writes"),
    (b"RRF", "a Rerun recording"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    (b"\x89PNG\r\n\x1a\n", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"GIF8", "a GIF image"),
    (b"%PDF", "a PDF document"),
    (b"version https://git-lfs", "a Git LFS pointer (git lfs pull fetches the file)"),
)


def describe_path(path: Path) -> str:
    """Describes what is at a path: `an HDF5 file`, `a folder of recordings (...)`, `no such file or folder`.

    Reads only file names and the first bytes of a file, and never raises.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return _folder_kind(path)
        if not stat.S_ISREG(mode):
            return "a pipe, socket or device"
        return _file_kind(path)
    except FileNotFoundError:
        return "no such file or folder"
    except CopolicyError:  # raised by visible_files for a sub-folder
        return "a folder with unreadable sub-folders"
    except OSError as error:
        return f"an unreadable path ({error.strerror or error})"


def _file_kind(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if not head:
        return "an empty file"
    for magic, description in _MAGIC:
        if head.startswith(magic):
            return description
    if head[4:8] == b"ftyp":
        return "an MP4 video"
    if head.startswith(b"PK"):
        return _zip_kind(path)
    if head[:1] == b"\x80" and head[1:2] <= b"\x05":
        return "a pickle"
    if not any(head):
        return "a file of zeros"
    return _text_kind(head)


def _zip_kind(path: Path) -> str:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, NotImplementedError, ValueError):
        return "a damaged zip archive"
    if names and all(name.endswith(".npy") for name in names):
        return "a NumPy archive (.npz)"
    if any(name.endswith(("/data.pkl", "/version")) for name in names):
        return "a PyTorch file"
    if any(name.rpartition("/")[2] in (".zarray", ".zgroup", "zarr.json") for name in names):
        return "a zipped Zarr store (copolicy-convert upstream reads the original program's)"
    return "a zip archive"


def _text_kind(head: bytes) -> str:
    try:
        text = head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 3:  # later errors may come from a character cut at the end of head
            return "a file of unknown format"
        text = head[: error.start].decode("utf-8")
    if any(character < " " and character not in "\t\r\n\f" for character in text):
        return "a file of unknown format"
    return "a JSON file" if text.lstrip().startswith(("{", "[")) else "a text file"


def _folder_kind(path: Path) -> str:
    if (path / INFO_FILE).is_file():
        return "a LeRobot data set (copolicy-dataset check and copolicy-convert export read it)"
    if any((path / name).is_file() for name in (".zgroup", ".zarray", "zarr.json")):
        return "a Zarr store (copolicy-convert upstream reads the original program's)"
    if (path / "config.json").is_file() and (path / "model.safetensors").is_file():
        return "a policy checkpoint (copolicy-eval and copolicy-cards read it)"
    if next(path.iterdir(), None) is None:
        return "an empty folder"
    files = visible_files(path, "*.mcap", "*.mcap.part", "*.pkl", "*.npz", "*.hdf5", "*.h5", "*.db3", "info.json")
    names = [file.name for file in files]
    if any(name.endswith(".mcap") for name in names):
        return "a folder of recordings (copolicy-convert mcap reads it)"
    if any(name.endswith(".part") for name in names):
        return "a folder of unfinished recordings (copolicy-collect recover reads it)"
    if any(file.match("trajectories/*.pkl") or file.stem == file.parent.name for file in files):
        return "a folder of the original program's files (copolicy-convert upstream reads it)"
    if any(file.match(INFO_FILE) for file in files):
        return "a folder that contains LeRobot data sets (name one of them)"
    suffixes = sorted({file.suffix for file in files})
    return f"a folder of other files ({', '.join(suffixes)})" if suffixes else "a folder of other files"
