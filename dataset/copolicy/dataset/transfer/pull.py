"""Downloads a published data set from the Hub and verifies it against its release."""

import shutil
from dataclasses import dataclass
from pathlib import Path

from ..exceptions import FileFormatError, RunError
from ..files.listing import visible_files
from ..files.meta_files import MANIFEST_FILE, RAW_FOLDER, RAW_MANIFEST_FILE
from ..files.staging import named_errors, rename_complete, require_new
from ..hub.repository import download, remove_download_state, resolve
from ..publication.repo_id import checked_repo_id
from ..versions.content import read_content
from ..versions.manifest import Manifest, file_entry
from ..versions.release_record import ReleaseRecord, read_release


@dataclass(frozen=True)
class PullResult:
    """A downloaded and verified data set."""

    root: str
    repo_id: str
    revision: str
    commit: str
    version: str
    content_hash: str
    files: int


def pull(repo_id: str, revision: str | None, root: Path, raw: bool = False) -> PullResult:
    """Downloads a data version to `root`, which appears only when complete and verified.

    An interrupted download leaves its files in a hidden folder beside `root`, and the next call resumes it.

    Args:
        revision: a tag, branch or commit; the newest `data-x.y.z` by default.
        raw: also download the recordings under `raw/`, if there are any.

    Raises:
        OutputExistsError: `root` exists.
        HubError: the Hub does not answer, or has no such data set or revision.
        RunError: the files differ from the manifest or the release.
        OSError: the disk is full or not writable; the files are deleted.
    """
    checked_repo_id(repo_id, "data set on the Hub")
    require_new(root)
    revision, commit = resolve(repo_id, revision)
    partial = root.parent / f".{root.name}.{commit[:12]}.partial"
    with named_errors(root, partial):
        try:
            download(repo_id, partial, commit, skip=None if raw else f"{RAW_FOLDER}/*")
        except OSError:
            shutil.rmtree(partial, ignore_errors=True)  # a full disk would stay full
            raise
        try:
            remove_download_state(partial)
            (partial / ".gitattributes").unlink(missing_ok=True)
            record, files = _verify(partial, f"{repo_id}@{revision}")
            rename_complete(partial, root)
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
    return PullResult(str(root), repo_id, revision, commit, record.version, record.content_hash, files)


def _verify(folder: Path, name: str) -> tuple[ReleaseRecord, int]:
    """Verifies files and content hash of a folder; returns its release and number of files."""
    try:
        record, manifest = read_release(folder), Manifest.read(folder / MANIFEST_FILE)
        differences = manifest.differences(Manifest.from_folder(folder))
        content_hash = read_content(folder).hash
        files = len(manifest.files) + 1
        if (folder / RAW_MANIFEST_FILE).exists():
            recordings = Manifest.read(folder / RAW_MANIFEST_FILE)
            entries = {
                file.relative_to(folder).as_posix(): file_entry(file)
                for file in visible_files(folder / RAW_FOLDER, "*.mcap")
            }
            differences += recordings.differences(Manifest(entries))
            files += len(recordings.files) + 1
    except FileFormatError as error:
        raise RunError(
            f"{name}: the download is not a release: {str(error).replace(f'{folder}', '').lstrip('/: ')}"
        ) from None
    if differences:
        raise RunError(f"{name}: expected the files in its manifest, found {differences[0]}; nothing was kept")
    if content_hash != record.content_hash:
        raise RunError(f"{name}: expected content {record.content_hash}, found {content_hash}; nothing was kept")
    return record, files
