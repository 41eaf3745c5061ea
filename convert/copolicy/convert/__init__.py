"""Recordings and files of the original program to LeRobot v3 data sets; data sets merged.

    from copolicy.convert import Conversion, convert_recordings

    convert_recordings([Path("recordings")], Path("dataset"), "my-lab/table", Conversion(fps=10, license="cc-by-4.0"))

Names are imported on first use.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .lerobot.append import append_recordings
    from .lerobot.prepare import Conversion
    from .merge.merge_datasets import merge_datasets
    from .recordings import convert_recordings
    from .upstream.build_episode import UpstreamOptions
    from .upstream.conversion import convert_upstream

__all__ = [
    "Conversion",
    "UpstreamOptions",
    "append_recordings",
    "convert_recordings",
    "convert_upstream",
    "merge_datasets",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "Conversion": "lerobot.prepare",
        "UpstreamOptions": "upstream.build_episode",
        "append_recordings": "lerobot.append",
        "convert_recordings": "recordings",
        "convert_upstream": "upstream.conversion",
        "merge_datasets": "merge.merge_datasets",
    },
)
