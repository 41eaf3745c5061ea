"""What stands between a policy of both players and an environment in which a partner plays the human."""

from dataclasses import dataclass
from typing import Any

from lerobot.configs import PipelineFeatureType, PolicyFeature
from lerobot.processor import ActionProcessorStep, ProcessorStepRegistry

_ROBOT = 2  # robot_fx, robot_fy


@dataclass
@ProcessorStepRegistry.register(name="table_carrying_robot_half")
class RobotHalfProcessorStep(ActionProcessorStep):
    """Takes the robot's half, `(..., 2)`, of an action of both players, `(..., 4)`."""

    def action(self, action: Any) -> Any:
        """The first two numbers of an action."""
        return action[..., :_ROBOT]

    def transform_features(
        self, features: dict[PipelineFeatureType, dict[str, PolicyFeature]]
    ) -> dict[PipelineFeatureType, dict[str, PolicyFeature]]:
        """The features with two numbers in each action."""
        actions = features.get(PipelineFeatureType.ACTION, {})
        halves = {name: PolicyFeature(feature.type, (_ROBOT,)) for name, feature in actions.items()}
        return {**features, PipelineFeatureType.ACTION: halves}
