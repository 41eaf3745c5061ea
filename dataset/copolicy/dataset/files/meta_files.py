"""Paths of a data set's metadata files, relative to its folder, with forward slashes."""

INFO_FILE = "meta/info.json"
"""LeRobot: rate, features, splits, numbers of episodes and frames."""

STATS_FILE = "meta/stats.json"
"""LeRobot: statistics of the frames, for normalisation."""

TASKS_FILE = "meta/tasks.parquet"
"""LeRobot: the sentence of each task."""

EPISODES_FOLDER = "meta/episodes"
"""LeRobot: Parquet files with one row per episode."""

RECORD_FILE = "meta/copolicy.json"
"""How a data set was made: converter, versions, notes by episode, and later changes."""

STATISTICS_FILE = "meta/copolicy_stats.json"
"""Multimodality statistics of `copolicy-dataset stats`."""

CHECK_FILE = "meta/copolicy_check.json"
"""Findings of `copolicy-dataset check`."""

RELEASE_FILE = "meta/copolicy_release.json"
"""Record of the newest release, written by `copolicy-dataset release`."""

EARLIER_FOLDER = "meta/copolicy_releases"
"""Records of earlier releases, `x.y.z.json`."""

MANIFEST_FILE = "meta/manifest.json"
"""Size and sha256 of every file of a release."""

WITHDRAWALS_FILE = "meta/copolicy_withdrawals.json"
"""Date of each withdrawal and how many episodes it removed."""

CROISSANT_FILE = "meta/croissant.json"
"""Croissant metadata, written by `copolicy-cards dataset --croissant`."""

CARD_FILE = "README.md"
CHANGELOG_FILE = "CHANGELOG.md"

RAW_FOLDER = "raw"
"""Recordings published together with the data set made from them."""

RAW_MANIFEST_FILE = f"{RAW_FOLDER}/manifest.json"
