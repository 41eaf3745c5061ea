"""What a withdrawal has to find: recordings of people, and a data set of them with everything that names them."""

import json
import shutil
from pathlib import Path

from checked_data import set_columns
from edited_data import columns

from copolicy.dataset.versions.manifest import Manifest, file_entry
from copolicy.dataset.versions.release import release


def withdrawable(made: Path, folder: Path) -> Path:
    """Writes to `folder` a data set `set` with raw copies, two releases, card and reports, and its `recordings`.

    Args:
        made: of `make_people`.
    """
    shutil.copytree(made.parent / "recordings", folder / "recordings")
    root = Path(shutil.copytree(made, folder / "set"))
    raw = root / "raw"
    shutil.copytree(folder / "recordings", raw)
    entries = {path.relative_to(root).as_posix(): file_entry(path) for path in raw.glob("*.mcap")}
    (raw / "manifest.json").write_text(Manifest(entries).to_text(), encoding="utf-8")
    rows = columns(root)
    record = json.loads((root / "meta/copolicy.json").read_text(encoding="utf-8"))
    record["notes"] = {rows[0]["episode_uuid"]: ["mended"], rows[2]["episode_uuid"]: ["doubtful"]}
    record["left_out"]["discarded"] = ["episode_000000.mcap", "episode_000099.mcap"]
    (root / "meta/copolicy.json").write_text(json.dumps(record), encoding="utf-8")
    release(root, "major", "Sessions of P01 and P02.")
    set_columns(root, license=["cc0-1.0"] * 8)
    release(root, "patch", f"Episode {rows[1]['episode_uuid']} under another licence.")
    (root / "README.md").write_text("P01 played two episodes", encoding="utf-8")
    (root / "figures").mkdir()
    (root / "figures" / "paths.png").write_bytes(b"paths of everybody")
    (root / "report.html").write_text("all trajectories", encoding="utf-8")
    (root / "meta/copolicy_stats.json").write_text('{"P01": 1}', encoding="utf-8")
    (root / "meta/copolicy_check.json").write_text('{"findings": []}', encoding="utf-8")
    (root / "LICENSE").write_text("a licence", encoding="utf-8")
    (root / "notes.txt").write_text("lab notes", encoding="utf-8")
    return folder
