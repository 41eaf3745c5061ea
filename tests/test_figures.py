"""Figures of trajectories whose cells, rates and forces are known because they were constructed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import get_task
from copolicy.evaluate.figures.command import conventions_of
from copolicy.evaluate.figures.episode_choice import Chosen, chosen_episodes
from copolicy.evaluate.figures.faults import CONCERNS, SENTENCES, Faults
from copolicy.evaluate.figures.force_map import force_map, interaction_map
from copolicy.evaluate.figures.force_path import force_path, published_path_values
from copolicy.evaluate.figures.grid import Grid
from copolicy.evaluate.figures.published import (
    bin_weights,
    published_arrays,
    published_counts,
    published_interaction_map,
    published_visitation,
)
from copolicy.evaluate.figures.success_by_map import rates_by_map, success_by_map
from copolicy.evaluate.figures.visitation import visit_rates, visitation
from copolicy.evaluate.trajectories import Trajectory
from copolicy.evaluate.trajectory_sources import Source, require_map
from copolicy.tasks.table.map_config import MapConfig

TABLE = get_task()
CONVENTIONS = conventions_of(TABLE)
ONE = MapConfig((240.0, 300.0, 0.0), (960.0, 300.0), ((600.0, 480.0),))
OTHER = MapConfig((240.0, 300.0, 0.0), (960.0, 300.0), ((720.0, 120.0),))
VISITS = Grid.over(TABLE.required_outline, 12.0)
FORCES = Grid.over(TABLE.required_outline, 50.0)


def carry(
    fps: int = 30,
    seconds: float = 4.0,
    speed: float = 30.0,
    force: float = 0.0,
    theta: float = 0.0,
    scenario: MapConfig = ONE,
    success: bool = True,
    map_id: str = "one",
) -> Trajectory:
    """A straight carry to the right from (240, 306) in which the players pull apart with a force."""
    steps = round(fps * seconds)
    states = np.zeros((steps + 1, 7))
    states[:, 0] = 240 + speed * np.arange(steps + 1) / fps
    states[:, 1:4] = 306.0, np.cos(theta), np.sin(theta)
    axis = np.array([np.cos(theta), -np.sin(theta)])  # from the human's end to the robot's, y down
    actions = np.tile(np.concatenate((force * axis, -force * axis)), (steps, 1))
    columns = {"success": success, "map_id": map_id, "robot": "R"}
    return Trajectory(states[:-1], actions, states[-1], fps, scenario, columns)


def source(*episodes: Trajectory, name: str = "S", demonstrations: bool = False) -> Source:
    return Source(name, "constructed", "nowhere", demonstrations, episodes, range(len(episodes)))


def only(**switches: bool) -> Faults:
    """Faults of which all but the named are off."""
    return replace(Faults(**dict.fromkeys(SENTENCES, False)), **switches)


def test_a_straight_carry_visits_its_cells_at_the_same_rate():
    rate, episodes = visit_rates(TABLE, [carry()], VISITS)
    # 120 px from x 240 on: cells 20 to 29 of 12 px, in row 306 // 12, a tenth of the time each.
    expected = np.zeros((50, 100))
    expected[25, 20:30] = 10.0
    np.testing.assert_allclose(rate, expected)
    np.testing.assert_array_equal(episodes, expected > 0)


@pytest.mark.parametrize("episodes", [[carry(fps=10)], [carry()] * 5, [carry(), carry(fps=10)]])
def test_the_rate_depends_neither_on_frames_a_second_nor_on_the_number_of_episodes(episodes):
    np.testing.assert_allclose(
        visit_rates(TABLE, episodes, VISITS).rate, visit_rates(TABLE, [carry()], VISITS).rate, atol=1e-9
    )


def test_a_long_episode_counts_as_much_as_a_short_one():
    still = carry(seconds=40.0, speed=0.0)
    rate, _ = visit_rates(TABLE, [carry(), still], VISITS)
    assert rate[25, 20] == pytest.approx(55.0)  # a tenth of one, all of the other
    assert rate[25, 29] == pytest.approx(5.0)
    assert rate.sum() == pytest.approx(100.0)


def test_a_data_set_without_final_state_is_measured_alike():
    stored = replace(carry(fps=10), final_state=None)
    rate, _ = visit_rates(TABLE, [stored], VISITS)
    np.testing.assert_allclose(rate[25, 20:29], 10.0)
    assert rate.sum() == pytest.approx(100.0)


def test_a_low_rate_skips_no_cell_and_its_forces_stay_in_place():
    fast = carry(fps=10, seconds=2.0, speed=240.0)  # two cells a frame
    rate, _ = visit_rates(TABLE, [fast], VISITS)
    assert (rate[25, 20:60] > 0).all()
    actions = fast.actions.copy()
    actions[fast.states[:, 0] >= 480, 0] = 1.0
    forces = force_map(TABLE, [replace(fast, actions=actions)], Grid.over(TABLE.required_outline, 60.0), (0.25,))
    np.testing.assert_array_equal(forces.proportion(1)[0, 5, 4:12], [0] * 4 + [100] * 4)


def test_the_first_row_is_at_the_upper_edge():
    grid = Grid.over(TABLE.required_outline, 50.0)
    assert (grid.rows, grid.columns) == (12, 24)
    sums = grid.sums(np.array([[1.0, 1.0], [1199.0, 599.0], [1300.0, -5.0]]))
    assert (sums[0, 0], sums[11, 23], sums[0, 23], sums.sum()) == (1, 1, 1, 3)


def test_the_interaction_map_is_the_proportion_of_the_time_above_each_threshold():
    # Half a second of 4 s in each cell: 240-250, 250-300, 300-350, 350-360 px at 30 px/s.
    weak, middle, strong = (carry(force=force) for force in (0.1, 0.5, 0.8))
    found = force_map(TABLE, [weak, middle, middle, strong], FORCES, CONVENTIONS.thresholds)
    assert found.samples[6, 4:8].tolist() == [40, 200, 200, 40]
    assert found.samples.sum() == 480
    assert found.episodes[6, 4:8].tolist() == [4, 4, 4, 4]
    shown = found.proportion(3)
    np.testing.assert_allclose(shown[:, 6, 5], [75.0, 25.0])
    assert np.isnan(shown[:, 6, 3]).all()
    assert np.isnan(found.proportion(5)).all()


def test_the_force_of_one_half_of_the_way_is_in_its_cells():
    episode = carry()
    actions = episode.actions.copy()
    actions[episode.states[:, 0] >= 300, 0] = 1.0  # half the difference: 0.5
    shown = force_map(TABLE, [replace(episode, actions=actions)], FORCES, (0.25,)).proportion(1)[0]
    np.testing.assert_allclose(shown[6, 4:8], [0, 0, 100, 100])


def test_the_paper_thresholds_are_in_our_unit():
    # The difference of unit forces along the table is 0.5 at the paper's first threshold.
    for difference, above in ((0.49, 0.0), (0.51, 100.0)):
        shown = force_map(TABLE, [carry(force=difference / 2)], FORCES, CONVENTIONS.thresholds).proportion(1)
        assert shown[0, 6, 5] == above
    for difference, above in ((1.49, 0.0), (1.51, 100.0)):
        shown = force_map(TABLE, [carry(force=difference / 2)], FORCES, CONVENTIONS.thresholds).proportion(1)
        assert shown[1, 6, 5] == above


def images(figure: Figure) -> list:
    return [axes.images[-1] for axes in figure.axes if axes.images and axes.get_label() != "<colorbar>"]


def polygons(axes, colour: str) -> list[list[list[float]]]:
    """Corners of the polygons of a colour, of the face or the edge."""
    rgb = to_rgba(colour)[:3]
    return [
        patch.get_xy()[:4].tolist()
        for patch in axes.patches
        if rgb in (patch.get_facecolor()[:3] if patch.get_fill() else None, patch.get_edgecolor()[:3])
    ]


def test_all_panels_share_a_scale_and_y_points_down():
    sources = [source(carry(), name="A"), source(carry(seconds=8.0, force=0.4), name="B")]
    for draw in (visitation, interaction_map):
        figure, numbers = draw(TABLE, CONVENTIONS, sources)
        norms = {(image.norm.vmin, image.norm.vmax) for image in images(figure)}
        assert norms == {(0, numbers["colour_scale"]["greatest"])}
        assert figure.axes[0].get_ylim() == (600, 0)
        assert figure.axes[0].get_ylabel() == "y, px (down)"


def test_obstacles_are_where_they_are():
    figure, _ = visitation(TABLE, CONVENTIONS, [source(carry(), carry(scenario=OTHER))])
    corners = polygons(figure.axes[0], "#555555")
    centres = sorted(tuple(np.mean(each, axis=0)) for each in corners)
    assert centres == [(600.0, 480.0), (720.0, 120.0)]
    assert not any(patch.get_fill() for patch in figure.axes[0].patches)  # no obstacle of both episodes
    figure, _ = visitation(TABLE, CONVENTIONS, [source(carry(), carry())])
    assert [patch.get_fill() for patch in figure.axes[0].patches] == [False, True]  # goal, common obstacle


def test_numbers_of_the_figure_are_those_of_the_cells():
    _, numbers = visitation(TABLE, CONVENTIONS, [source(carry())])
    cells = numbers["panels"]["S"]
    assert [(cell["row"], cell["column"]) for cell in cells] == [(25, column) for column in range(20, 30)]
    assert {cell["rate"] for cell in cells} == {10.0}
    _, numbers = interaction_map(TABLE, CONVENTIONS, [source(carry(force=0.5))], 1)
    assert numbers["panels"]["S"][1] == {"row": 6, "column": 5, "samples": 50, "episodes": 1, "above": [50, 0]}
    assert numbers["thresholds"] == [0.25, 0.75]


def test_counts_of_frames_grow_with_rate_episodes_and_length():
    counts = [
        published_counts(TABLE, episodes, VISITS).sum()
        for episodes in ([carry()], [carry(fps=10)], [carry()] * 2, [carry(seconds=8.0)])
    ]
    assert counts == [120, 40, 240, 240]
    raw, corrected = (
        published_visitation(TABLE, CONVENTIONS, [source(carry(seconds=8.0))], only(raw_counts=switch))
        for switch in (True, False)
    )
    assert (images(raw)[0].norm.vmax, images(raw)[0].get_array().sum()) == (800, 240)
    assert images(corrected)[0].get_array().sum() == pytest.approx(100)


def arrays(sources: Sequence[Source], **switches: bool) -> list[np.ndarray]:
    return published_arrays(TABLE, CONVENTIONS, sources, FORCES, only(raw_counts=True, **switches))


def test_an_array_that_is_not_reset_adds_the_panels_up():
    sources = [source(carry(force=0.3), name="A"), source(carry(force=0.6), name="B")]
    first, second = arrays(sources)
    assert (first.sum(), second.sum()) == (120, 240)  # 30 and 60 on the program's scale: weights 1 and 2
    sums = arrays(sources, accumulated=True)
    np.testing.assert_array_equal(sums[0], first)
    np.testing.assert_array_equal(sums[1], first + second)
    # In the other order the same source has another panel.
    assert [each.sum() for each in arrays(sources[::-1], accumulated=True)] == [240, 360]


def test_unit_forces_of_demonstrations_fall_into_the_zero_bin():
    strongest = source(carry(force=1.0), demonstrations=True)
    assert arrays([strongest])[0].sum() == 3 * 120
    assert arrays([strongest], unit_demonstrations=True)[0].sum() == 0
    study = source(carry(force=1.0))
    assert arrays([study], unit_demonstrations=True)[0].sum() == 3 * 120


def test_the_mirrored_axis_hides_a_force_at_45_degrees():
    pulling = source(carry(force=0.8, theta=np.pi / 4))
    assert arrays([pulling])[0].sum() == 3 * 120
    assert arrays([pulling], mirrored_axis=True)[0].sum() == 0
    flat = source(carry(force=0.8))
    assert arrays([flat], mirrored_axis=True)[0].sum() == 3 * 120


def test_bins_are_those_of_the_released_code():
    values = np.array([0.0, 24.9, 25.0, 25.1, -49.0, 50.0, 50.1, 69.9, -70.0, 141.0])
    assert bin_weights(values, (25.0, 50.0, 70.0)).tolist() == [0, 0, 0, 1, 1, 0, 2, 2, 3, 3]


def test_a_range_of_colours_for_each_panel_makes_unlike_panels_look_alike():
    sources = [source(carry(force=0.3), name="A"), source(carry(force=0.8), name="B")]
    own, common = (
        [image.norm.vmax for image in images(published_interaction_map(TABLE, CONVENTIONS, sources, only(**switches)))]
        for switches in ({"own_scales": True}, {})
    )
    assert own == [1, 3]
    assert common == [3, 3]


@pytest.mark.parametrize("draw", [published_visitation, published_interaction_map])
def test_shifted_obstacles_begin_at_their_centre_and_y_points_up(draw):
    sources = [source(carry(force=0.3))]
    right, shifted, up = (
        draw(TABLE, CONVENTIONS, sources, only(**dict.fromkeys(names, True)))
        for names in ((), ("shifted_obstacles",), ("y_up",))
    )
    ((first, *_),) = polygons(right.axes[0], "red")
    assert first == [600 - 22.5, 480 - 22.5]
    ((first, *_),) = polygons(shifted.axes[0], "red")
    assert first == [600, 480]
    assert (right.axes[0].get_ylim(), up.axes[0].get_ylim()) == ((600, 0), (0, 600))
    assert "UP" in up.axes[0].get_ylabel()


def test_a_path_of_demonstrations_loses_its_unit_and_its_sign():
    pressing = carry(force=-0.5)
    demonstration = Chosen(source(pressing, demonstrations=True), 0, pressing)
    study = Chosen(source(pressing), 0, pressing)
    published = CONVENTIONS.published
    assert published is not None

    def value(chosen: Chosen, **switches: bool) -> float:
        values = published_path_values(TABLE, published, chosen, only(**switches))
        assert np.ptp(values) < 1e-9
        return float(values[0])

    assert value(demonstration) == value(study) == pytest.approx(-50)
    assert value(demonstration, unit_demonstrations=True) == pytest.approx(-1)
    assert value(demonstration, unsigned_demonstrations=True) == pytest.approx(50)
    everything = dict.fromkeys(SENTENCES, True)
    assert value(study, **everything) == pytest.approx(-50)
    assert value(demonstration, **everything) == pytest.approx(1)


def test_a_title_names_the_faults_of_its_figure():
    sources = [source(carry(force=0.3))]
    title = published_visitation(TABLE, CONVENTIONS, sources, Faults()).get_suptitle().replace("\n", " ")
    assert "AS PUBLISHED" in title
    assert all((SENTENCES[name] in title) == (name in CONCERNS["visitation"]) for name in SENTENCES)
    assert Faults.named([]) == Faults()
    assert Faults.named(["y_up"]) == only(y_up=True)
    with pytest.raises(UnknownNameError, match="unknown fault 'y_down'; available: accumulated"):
        Faults.named(["y_down"])


def test_the_path_is_of_the_median_success_on_a_common_map():
    first = source(
        carry(scenario=OTHER), carry(force=0.6), carry(force=0.2), carry(force=0.4), carry(force=0.9, success=False),
        name="A",
    )  # fmt: skip
    second = source(carry(force=0.7), carry(force=0.3), name="B")
    chosen, rule = chosen_episodes(TABLE, [first, second], [])
    assert [each.number for each in chosen] == [3, 1]
    assert rule.startswith("the map with successes of most sources")
    chosen, rule = chosen_episodes(TABLE, [first, second], ["A=4"])
    assert [each.number for each in chosen] == [4, 1]
    assert rule.startswith("by --episode: A; the map")
    figure, numbers = force_path(TABLE, chosen, rule)
    panel = numbers["panels"]["A"]
    assert (panel["episode"], panel["interaction"][0]) == (4, 0.9)
    assert panel["path"][0] == [240.0, 306.0]
    assert "did not reach the goal after 4.0 s, mean magnitude 0.900" in figure.axes[0].get_title(loc="left")
    scales = {axes.collections[0].get_clim() for axes in figure.axes[:2]}
    assert scales == {(-numbers["colour_scale"]["greatest"], numbers["colour_scale"]["greatest"])}


def test_a_source_without_a_success_shows_its_median_episode():
    failed = source(*(carry(force=force, success=False) for force in (0.5, 0.1, 0.3)), name="A")
    chosen, _ = chosen_episodes(TABLE, [failed], [])
    assert chosen[0].number == 2


@pytest.mark.parametrize("text", ["B=0", "S", "S=x", "S=7"])
def test_an_episode_that_is_not_there_is_refused(text):
    with pytest.raises(InvalidValueError, match=rf"^--episode: expected .* found '{text}'$"):
        chosen_episodes(TABLE, [source(carry())], [text])


def test_success_by_map_begins_with_the_hardest():
    first = source(carry(), carry(), carry(map_id="two", success=False), name="A")
    second = source(carry(map_id="two"), carry(map_id="three", success=False), name="B")
    rates = rates_by_map([first, second])
    assert list(rates) == ["all", "three", "two", "one"]
    assert (rates["all"]["A"]["mean"], rates["one"]["A"]["episodes"]) == (pytest.approx(2 / 3), 2)
    assert list(rates["one"]) == ["A"]
    assert rates["three"]["B"]["wilson_95"] == pytest.approx([0, 0.7935], abs=1e-4)
    figure, numbers = success_by_map(TABLE, [first, second])
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == [
        "all (n 2-3)", "three (n 1)", "two (n 1)", "one (n 2)"
    ]  # fmt: skip
    assert numbers["maps"] == rates


def test_many_maps_without_a_failure_share_a_row():
    episodes = [carry(map_id=f"m{index}", success=index != 4) for index in range(30)]
    figure, numbers = success_by_map(TABLE, [source(*episodes)])
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["all (n 30)", "m4 (n 1)", "29 without a failure (n 29)"]
    assert len(numbers["maps"]) == 31


def test_a_map_is_its_obstacles_and_goal_whatever_the_start():
    turned = replace(ONE, start=(300.0, 200.0, 1.0))
    first = source(carry(), carry(scenario=OTHER, map_id="two"), name="A")
    second = source(carry(scenario=OTHER, map_id="two"), carry(scenario=turned, map_id="one-90deg"), name="B")
    kept = require_map(TABLE, [first, second], "one")
    assert [list(each.numbers) for each in kept] == [[0], [1]]
    both = source(carry(), carry(scenario=OTHER, map_id="one"), carry(scenario=turned, map_id="three"), name="A")
    (kept,) = require_map(TABLE, [both], "one")  # a name of two maps takes both
    assert list(kept.numbers) == [0, 1, 2]
    with pytest.raises(
        InvalidValueError, match="--map: expected the map_id of an episode, such as one, two, found 'x'"
    ):
        require_map(TABLE, [first, second], "x")
    with pytest.raises(InvalidValueError, match="--map: expected a map on which B has episodes, found 'two'"):
        require_map(TABLE, [first, source(carry(), name="B")], "two")
