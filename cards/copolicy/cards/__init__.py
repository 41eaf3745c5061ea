"""Cards of data sets and policies.

    from copolicy.cards import DatasetFacts, render_dataset_card

    print(render_dataset_card(DatasetFacts.read(Path("dataset")), "my-lab/table"))

Names are imported on first use.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .checkpoint_facts import CheckpointFacts
    from .dataset_card import render_dataset_card
    from .facts import DatasetFacts
    from .model_card import render_model_card

__all__ = ["CheckpointFacts", "DatasetFacts", "render_dataset_card", "render_model_card"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "CheckpointFacts": "checkpoint_facts",
        "DatasetFacts": "facts",
        "render_dataset_card": "dataset_card",
        "render_model_card": "model_card",
    },
)
