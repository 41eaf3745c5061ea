"""What a file or folder is that a command did not expect, in words, with the command that takes it."""

import stat
import zipfile
from pathlib import Path

from ..exceptions import CopolicyError
from .listing import visible_files
from .meta_files import INFO_FILE

_HEAD = 512  # bytes that tell what a file is
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
    (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"%PDF", "a PDF document"),
    (b"version https://git-lfs", "a pointer of Git LFS in place of the file (git lfs pull fetches it)"),
)


def kind_of(path: Path) -> str:
    """What lies at a path, as a noun with its article: `an HDF5 file`, `a folder of recordings (...)`, `nothing there`.

    Looks at names and at the first bytes, never at more, and never fails.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return _folder_kind(path)
        if not stat.S_ISREG(mode):
            return "a pipe, socket or device"
        return _file_kind(path)
    except FileNotFoundError:
        return "nothing there"
    except CopolicyError:  # a folder inside it
        return "a folder with folders that cannot be read"
    except OSError as error:
        return f"what cannot be read ({error.strerror or error})"


def _file_kind(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if not head:
        return "an empty file"
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            return kind
    if head[4:8] == b"ftyp":
        return "an MP4 video"
    if head.startswith(b"PK"):
        return _zip_kind(path)
    if head[:1] == b"\x80" and head[1:2] <= b"\x05":
        return "a pickle"
    if not any(head):
        return "zeros"
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
        return "a zipped Zarr store (copolicy-convert upstream takes the original program's)"
    return "a zip archive"


def _text_kind(head: bytes) -> str:
    try:
        text = head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 3:  # else a letter that the first bytes cut in two
            return "a file of another kind"
        text = head[: error.start].decode("utf-8")
    if any(letter < " " and letter not in "\t\r\n\f" for letter in text):
        return "a file of another kind"
    return "a JSON file" if text.lstrip().startswith(("{", "[")) else "a text file"


def _folder_kind(path: Path) -> str:
    if (path / INFO_FILE).is_file():
        return "a LeRobot data set (copolicy-dataset check and copolicy-convert export take it)"
    if any((path / name).is_file() for name in (".zgroup", ".zarray", "zarr.json")):
        return "a Zarr store (copolicy-convert upstream takes the original program's)"
    if (path / "config.json").is_file() and (path / "model.safetensors").is_file():
        return "a checkpoint of a policy (copolicy-eval and copolicy-cards take it)"
    if next(path.iterdir(), None) is None:
        return "an empty folder"
    files = visible_files(path, "*.mcap", "*.mcap.part", "*.pkl", "*.npz", "*.hdf5", "*.h5", "*.db3", "info.json")
    names = [file.name for file in files]
    if any(name.endswith(".mcap") for name in names):
        return "a folder of recordings (copolicy-convert mcap takes it)"
    if any(name.endswith(".part") for name in names):
        return "a folder of recordings that broke off (copolicy-collect recover takes it)"
    if any(file.match("trajectories/*.pkl") or file.stem == file.parent.name for file in files):
        return "a folder of the original program's files (copolicy-convert upstream takes it)"
    if any(file.match(INFO_FILE) for file in files):
        return "a folder with LeRobot data sets in it (name one of them)"
    endings = sorted({file.suffix for file in files})
    return f"a folder of other files ({', '.join(endings)})" if endings else "a folder of other files"
