"""Processor between a policy of both players and an environment whose partner acts for the human."""

from dataclasses import dataclass
from typing import Any

from lerobot.configs import PipelineFeatureType, PolicyFeature
from lerobot.processor import ActionProcessorStep, ProcessorStepRegistry


@dataclass
@ProcessorStepRegistry.register(name="table_carrying_robot_half")
class RobotHalfProcessorStep(ActionProcessorStep):
    """Keeps the robot's half `(..., size)` of a joint action `(..., 2 size)`."""

    size: int = 2  # numbers of one player's action

    def action(self, action: Any) -> Any:
        """The first `size` values of an action."""
        return action[..., : self.size]

    def transform_features(
        self, features: dict[PipelineFeatureType, dict[str, PolicyFeature]]
    ) -> dict[PipelineFeatureType, dict[str, PolicyFeature]]:
        """The features with `size` values in each action."""
        actions = features.get(PipelineFeatureType.ACTION, {})
        halves = {name: PolicyFeature(feature.type, (self.size,)) for name, feature in actions.items()}
        return {**features, PipelineFeatureType.ACTION: halves}
