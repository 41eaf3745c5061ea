"""Names of the files of a data set beside its frames and videos, as paths below its folder with forward slashes."""

INFO_FILE = "meta/info.json"
"""LeRobot's: rate, features, splits, numbers of episodes and frames."""

STATS_FILE = "meta/stats.json"
"""LeRobot's: statistics of the frames, for normalisation."""

TASKS_FILE = "meta/tasks.parquet"
"""LeRobot's: the sentence of each task."""

EPISODES_FOLDER = "meta/episodes"
"""LeRobot's: Parquet files with one row an episode."""

RECORD_FILE = "meta/copolicy.json"
"""How a data set was made: converter, versions, notes by episode; and what was done to it since."""

STATISTICS_FILE = "meta/copolicy_stats.json"
"""Multimodality statistics of `copolicy-dataset stats`."""

CHECK_FILE = "meta/copolicy_check.json"
"""Findings of `copolicy-dataset check`."""

RELEASE_FILE = "meta/copolicy_release.json"
"""The newest release, made by `copolicy-dataset release`."""

EARLIER_FOLDER = "meta/copolicy_releases"
"""The records of the releases before it, `x.y.z.json`."""

MANIFEST_FILE = "meta/manifest.json"
"""Size and sha256 of every file of a release."""

WITHDRAWALS_FILE = "meta/copolicy_withdrawals.json"
"""That episodes were withdrawn, and when."""

CROISSANT_FILE = "meta/croissant.json"
"""Croissant's description, made by `copolicy-cards dataset --croissant`."""

CARD_FILE = "README.md"
CHANGELOG_FILE = "CHANGELOG.md"

RAW_FOLDER = "raw"
"""Recordings that were published beside the data set made from them."""

RAW_MANIFEST_FILE = f"{RAW_FOLDER}/manifest.json"
