"""Sound files of every kind that a command reads, and copies of them damaged at random."""

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import mcap_variants
import numpy as np
import upstream_files
import zarr

from copolicy.convert.upstream.zarr_arrays import ZarrArrays

STEPS = 12


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Bits flipped, the end cut off, zeros, bytes missing, bytes from elsewhere in the file, or a text in its place."""
    copy = bytearray(content)
    kind, begin, length = int(rng.integers(6)), int(rng.integers(len(copy))), int(rng.integers(1, 200))
    if kind == 0:
        for place in rng.integers(len(copy), size=int(rng.integers(1, 9))):
            copy[place] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del copy[begin:]
    elif kind == 2:
        copy[begin : begin + length] = bytes(len(copy[begin : begin + length]))
    elif kind == 3:
        del copy[begin : begin + length]
    elif kind == 4:
        other = int(rng.integers(len(copy)))
        copy[begin : begin + length] = copy[other : other + length]
    else:
        word = (b"null", b"-1", b"1e999", b'"x"', b"[]", b"{}", b"999999999999")[int(rng.integers(7))]
        copy[begin : begin + len(word)] = word
    return bytes(copy)


def damage_one(folder: Path, rng: np.random.Generator) -> None:
    """Damages one file of a folder, or takes it away, or puts a folder in its place."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.stat().st_size)
    file = files[int(rng.integers(len(files)))]
    fate = int(rng.integers(10))
    content = file.read_bytes()
    if fate < 8:
        file.write_bytes(damaged(content, rng))
    else:
        file.unlink()
        if fate == 9:
            file.mkdir()


def _recordings(recording: Path, name: str) -> Callable[[Path], Path]:
    variant = mcap_variants.VERIFIED.get(name) or mcap_variants.UNVERIFIED[name][0]

    def build(folder: Path) -> Path:
        folder.mkdir()
        variant(recording, folder / "episode_000.mcap")
        return folder

    return build


def _raw(folder: Path) -> Path:
    folder.mkdir()
    states, actions = upstream_files.play(upstream_files.random_forces(STEPS))
    upstream_files.write_raw(folder, states, actions, map_config=upstream_files.CONFIG)
    return folder


def _processed(folder: Path) -> Path:
    states, actions = upstream_files.play(upstream_files.random_forces(STEPS))
    pose = np.column_stack((states[1:, :2], np.cos(states[1:, 2]), np.sin(states[1:, 2])))
    config = upstream_files.CONFIG
    obstacles = np.zeros(3)
    conditions = np.tile([*config.start, *config.goal, *obstacles], (STEPS, 1))
    folder.mkdir()
    upstream_files.write_processed(folder / "ep_1" / "ep_1.npz", pose, actions, conditions)
    return folder


def _store(version: int, zipped: bool = False) -> Callable[[Path], Path]:
    def build(folder: Path) -> Path:
        folder.mkdir()
        states, actions = upstream_files.play(upstream_files.random_forces(STEPS))
        upstream_files.write_store(folder / "plain", states, actions)
        arrays = ZarrArrays(folder / "plain", "data/obs")
        group = zarr.open_group(folder / "table.zarr", mode="w", zarr_format=version)  # type: ignore[arg-type]
        for name in ("data/obs", "data/action", "data/past_action", "meta/episode_ends"):
            group.create_array(name, data=arrays.read(name))
        shutil.rmtree(folder / "plain")
        if zipped:
            with zipfile.ZipFile(folder / "table.zarr.zip", "w") as archive:
                for file in sorted((folder / "table.zarr").rglob("*")):
                    archive.write(file, file.relative_to(folder / "table.zarr"))
            shutil.rmtree(folder / "table.zarr")
        return folder

    return build


def sound(recording: Path) -> dict[str, tuple[tuple[str, ...], Callable[[Path], Path]]]:
    """By kind of file: the commands that take it (keys of `reading_commands.COMMANDS`), and what makes a folder of it.

    Args:
        recording: one of ours.
    """
    reading = ("collect replay", "collect recover", "dataset check", "convert mcap", "eval human summarise")
    layouts = ("zstd", "unchunked", "no sums", "unchunked, no sums", "zstd without size or sums")
    upstream = {
        "raw": _raw, "processed": _processed, "zarr v2": _store(2), "zarr v3": _store(3), "zarr zip": _store(2, True),
    }  # fmt: skip
    return {
        **{f"mcap {name}": (reading, _recordings(recording, name)) for name in layouts},
        **{kind: (("convert upstream",), build) for kind, build in upstream.items()},
    }
