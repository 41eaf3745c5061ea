"""Messages of the table in recordings: state, actions, interaction, and scenes for Foxglove and Rerun."""

from collections.abc import Sequence

import numpy as np

from copolicy.dataset.recording.messages.copolicy_pb2 import Interaction, PlayerAction, TableState
from copolicy.dataset.recording.task_messages import SceneWriter, TaskMessages
from copolicy.dataset.recording.topics import Record, Topic, player_metadata
from copolicy.dataset.task_spec import RECORD_HZ

from .artist.scene import SCENE, SCENE_MAP, TableScene, map_scene
from .artist.scene_solids import MAP_SOLIDS, TABLE_FRAME, TABLE_SOLIDS, TableFrame, solid_records
from .interaction import interaction_force
from .map_config import MapConfig

_FRAME = "screen: origin top left, x right, y down, theta counter-clockwise on screen"

TABLE_STATE = Topic(
    "/table/state",
    TableState,
    {"units": "x, y: px; theta: rad; vx, vy: px/s; omega: rad/s; sim_time: s", "frame": _FRAME},
)
_ROBOT, _HUMAN = (
    Topic(
        f"/player/{player}/action",
        PlayerAction,
        {"units": "fx, fy: a player's full force, [-1, 1]", "frame": _FRAME, **player_metadata(player)},
    )
    for player in range(2)
)
ACTIONS = (_ROBOT, _HUMAN)
INTERACTION = Topic("/interaction", Interaction, {"units": "force: a player's full force; positive pulls apart"})


class TableMessages(TaskMessages):
    """Encodes and decodes the table's messages; see `TaskMessages`."""

    scenario_file = "map_config.json"
    state = TABLE_STATE
    actions = ACTIONS
    measures = INTERACTION
    scene = (SCENE_MAP, SCENE, TABLE_FRAME, *MAP_SOLIDS, *TABLE_SOLIDS)

    def encode_state(self, step: int, recorded: Sequence[float], monotonic_ns: int) -> bytes:
        x, y, theta, vx, vy, omega = recorded
        state = TableState(
            step=step,
            sim_time=step / RECORD_HZ,
            x=x,
            y=y,
            theta=theta,
            vx=vx,
            vy=vy,
            omega=omega,
            monotonic_ns=monotonic_ns,
        )
        return state.SerializeToString()

    def decode_state(self, payload: bytes) -> tuple[int, Sequence[float]]:
        state = TableState.FromString(payload)
        return state.step, (state.x, state.y, state.theta, state.vx, state.vy, state.omega)

    def encode_action(self, step: int, action: Sequence[float]) -> bytes:
        fx, fy = action
        return PlayerAction(step=step, fx=fx, fy=fy).SerializeToString()

    def decode_action(self, payload: bytes) -> tuple[int, Sequence[float]]:
        action = PlayerAction.FromString(payload)
        return action.step, (action.fx, action.fy)

    def encode_measures(self, step: int, recorded: Sequence[float], action: Sequence[float], reward: float) -> bytes:
        force = float(interaction_force(recorded[2], np.array(action)))
        return Interaction(step=step, force=force, reward=reward).SerializeToString()

    def decode_reward(self, payload: bytes) -> float:
        return Interaction.FromString(payload).reward

    def scenario_records(self, scenario: MapConfig, time_ns: int) -> list[Record]:
        """Goal, obstacles and window border, and the table's solids in the frame `table`."""
        return [(SCENE_MAP, map_scene(scenario, time_ns)), *solid_records(scenario, time_ns)]

    def scene_writer(self) -> SceneWriter:
        """Writes the table and the forces as a SceneUpdate, and the table's frame as a FrameTransform."""
        scene, frame = TableScene(), TableFrame()

        def records(time_ns: int, recorded: Sequence[float], action: Sequence[float]) -> list[Record]:
            x, y, theta, *_ = recorded
            pose = x, y, theta
            return [(SCENE, scene.update(time_ns, pose, tuple(action))), frame.record(time_ns, pose)]

        return records
