"""Reads arrays of numbers from a Zarr store of version 2 or 3, a folder or one zip file.

The `zarr` library decodes the chunks. The metadata are checked first: a codec may unpickle, and a shape or an archive
may require more memory than any demonstrations need.
"""

import json
import math
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.files.file_kinds import describe_path

from .restricted_pickle import first_line

_LARGEST = 1 << 30  # bytes of an array, of a chunk and of an unpacked archive
_LARGEST_METADATA = 1 << 20
_MOST_CHUNKS = 1 << 20
_COMPRESSORS = ("blosc", "bz2", "gzip", "lz4", "lzma", "zlib", "zstd")  # of version 2; numcodecs also has pickle
_CODECS = ("blosc", "bytes", "crc32c", "gzip", "sharding_indexed", "transpose", "zstd")  # of version 3


def array_metadata_files(array: str) -> tuple[str, str]:
    """Metadata files of an array in a store of version 2 and of version 3."""
    return f"{array}/.zarray", f"{array}/zarr.json"


def is_zipped(path: Path) -> bool:
    """Whether the path is a zip file."""
    return path.is_file() and zipfile.is_zipfile(path)


class ZarrArrays:
    """The arrays of a store.

    Attributes:
        path: the folder or the zip file.
    """

    def __init__(self, path: Path, array: str):
        """
        Args:
            array: an array that must exist, such as `data/obs`; in an archive it may be in a sub-folder.

        Raises:
            FileFormatError: no such store, or an archive that is damaged, too large or has names outside of it.
        """
        self.path = path
        self._prefix = ""
        self._members: dict[str, zipfile.ZipInfo] | None = None
        if path.is_file():
            self._members = _members(path)
            ends = array_metadata_files(array)
            prefixes = {name.removesuffix(end) for name in self._members for end in ends if name.endswith(end)}
            prefixes = {prefix for prefix in prefixes if not prefix or prefix.endswith("/")}
            if len(prefixes) != 1:
                found = f"{len(prefixes)} of them" if prefixes else f"{describe_path(path)} without it"
                raise FileFormatError(path, f"one zipped Zarr store with an array {array}", found)
            self._prefix = prefixes.pop()

    def read(self, array: str) -> Array:
        """Reads an array by its path in the store.

        Raises:
            FileFormatError: no such array, unsupported metadata (filters, data types other than numbers, codecs other
                than the numeric ones, too large a size), or a damaged chunk.
            MissingExtraError: zarr is not installed.
        """
        version = self._checked_version(array)
        try:
            import zarr
            from zarr.storage import LocalStore, ZipStore
        except ImportError:
            raise MissingExtraError("zarr") from None
        try:
            store = (LocalStore if self._members is None else ZipStore)(self.path, read_only=True)
            try:
                opened = zarr.open_array(store, path=f"{self._prefix}{array}", zarr_format=version, mode="r")  # type: ignore[arg-type]
                return np.asarray(opened[...])
            finally:
                store.close()
        except (Exception, MemoryError) as error:  # codecs raise many types of errors
            raise FileFormatError(self.path / array, "an array with intact chunks", first_line(error)) from None

    def _checked_version(self, array: str) -> int:
        """Checks the metadata of an array: numbers only, size within limits; returns its Zarr version."""
        for name, version, require in zip(array_metadata_files(array), (2, 3), (_require_2, _require_3), strict=True):
            text = self._text(name)
            if text is None:
                continue
            try:
                require(json.loads(text))
            except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
                raise FileFormatError(
                    self.path / name, "the metadata of an array of numbers", first_line(error)
                ) from None
            return version
        raise FileFormatError(self.path / array, "a Zarr array (.zarray or zarr.json)", "none")

    def _text(self, name: str) -> bytes | None:
        try:
            if self._members is not None:
                member = self._members.get(self._prefix + name)
                if member is None:
                    return None
                with zipfile.ZipFile(self.path) as archive, archive.open(member) as file:
                    return file.read(_LARGEST_METADATA)
            path = self.path / name
            if not path.is_file():
                return None
            with path.open("rb") as file:
                return file.read(_LARGEST_METADATA)
        except Exception as error:  # zlib, CRC, encryption, permissions
            raise FileFormatError(self.path / name, "readable metadata of an array", first_line(error)) from None


def _members(path: Path) -> dict[str, zipfile.ZipInfo]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except OSError as error:
        raise FileFormatError(path, "a readable zip file", error.strerror or str(error)) from None
    except Exception as error:
        description = describe_path(path)
        description = f"a damaged one ({first_line(error)})" if "zip" in description else description
        raise FileFormatError(path, "a zipped Zarr store", description) from None
    for member in members:
        name = PurePosixPath(member.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or any(":" in part for part in name.parts[:1]):
            raise FileFormatError(path, "names inside of the archive", repr(member.filename))
    size = sum(member.file_size for member in members)
    if size > _LARGEST:
        raise FileFormatError(path, f"an archive of at most {_LARGEST >> 20} MiB unpacked", f"{size >> 20} MiB")
    return {member.filename: member for member in members}


def _require_2(fields: dict[str, Any]) -> None:
    if fields["zarr_format"] != 2:
        raise ValueError(f"zarr_format {fields['zarr_format']!r}")
    if fields.get("filters"):
        raise ValueError(f"filters {fields['filters']!r}")
    compressor = fields["compressor"]
    if compressor is not None and compressor.get("id") not in _COMPRESSORS:
        raise ValueError(f"compressor {compressor.get('id')!r}, none of {', '.join(_COMPRESSORS)}")
    dtype = np.dtype(fields["dtype"])
    if dtype.kind not in "biuf":
        raise ValueError(f"data type {fields['dtype']!r}")
    _require_size(fields["shape"], fields["chunks"], dtype.itemsize)


def _require_3(fields: dict[str, Any]) -> None:
    if (fields["zarr_format"], fields["node_type"]) != (3, "array"):
        raise ValueError(f"zarr_format {fields['zarr_format']!r}, node_type {fields['node_type']!r}")
    if fields.get("storage_transformers"):
        raise ValueError(f"storage_transformers {fields['storage_transformers']!r}")
    if not isinstance(fields["data_type"], str) or np.dtype(fields["data_type"]).kind not in "biuf":
        raise ValueError(f"data type {fields['data_type']!r}")
    grid = fields["chunk_grid"]
    if grid["name"] != "regular":
        raise ValueError(f"chunk_grid {grid['name']!r}")
    itemsize = np.dtype(fields["data_type"]).itemsize
    _require_size(fields["shape"], grid["configuration"]["chunk_shape"], itemsize)
    _require_codecs(fields["codecs"])


def _require_codecs(codecs: list[Any]) -> None:
    for entry in codecs:
        codec: dict[str, Any] = {"name": entry} if isinstance(entry, str) else entry
        name = codec["name"]
        if name not in _CODECS:
            raise ValueError(f"codec {name!r}, none of {', '.join(_CODECS)}")
        if name == "sharding_indexed":
            _require_codecs(codec["configuration"]["codecs"])
            _require_codecs(codec["configuration"].get("index_codecs", []))


def _require_size(shape: list[int], chunks: list[int], itemsize: int) -> None:
    if not all(type(size) is int for size in (*shape, *chunks)) or len(shape) != len(chunks):
        raise ValueError(f"shape {shape} in chunks {chunks}")
    if min((*chunks, 1)) < 1 or min((*shape, 0)) < 0:
        raise ValueError(f"shape {shape} in chunks {chunks}")
    number = math.prod(-(-size // chunk) for size, chunk in zip(shape, chunks, strict=True))
    if max(math.prod(shape), math.prod(chunks)) * itemsize > _LARGEST or number > _MOST_CHUNKS:
        raise ValueError(f"shape {shape} in chunks {chunks}, more than {_LARGEST >> 20} MiB or {_MOST_CHUNKS} chunks")
