"""The player of episodes in a browser."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect
from report_page import canvas_pixels

from copolicy.cards.episode_frames import read_frames
from copolicy.cards.facts import DatasetFacts

EPISODES = 5


def test_an_episode_plays_by_keyboard(visit, report, report_set):
    page = visit.open(report)
    open_first = page.get_by_role("button", name=re.compile(r"^Open Episode 0,"))
    open_first.focus()
    page.keyboard.press("Enter")
    player = page.get_by_role("dialog")
    expect(player).to_be_visible()
    expect(page.locator("#player-facts")).to_contain_text("simulated pair · pair ")
    frames = DatasetFacts.read(report_set).episodes[0]["length"]
    start = canvas_pixels(page, "#stage")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#player-readout")).to_contain_text(f"0.1 of {(frames - 1) / 10:.1f} s")
    page.keyboard.press("Shift+ArrowRight")
    expect(page.locator("#scrub")).to_have_value("11")
    page.keyboard.press("End")
    expect(page.locator("#scrub")).to_have_attribute(
        "aria-valuetext", f"{(frames - 1) / 10:.1f} of {(frames - 1) / 10:.1f} seconds"
    )
    assert canvas_pixels(page, "#stage") != start
    page.keyboard.press("Home")
    assert canvas_pixels(page, "#stage") == start
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_attribute("aria-label", "Pause")
    expect(page.locator("#player-readout")).to_contain_text(re.compile(r"^0\.[2-9] of"))
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_attribute("aria-label", "Play")
    page.keyboard.press("n")
    expect(page.locator("#player-title")).to_have_text("Episode 1")
    page.keyboard.press("Escape")
    expect(player).to_be_hidden()
    expect(open_first).to_be_focused()


def test_scrubbing_shows_the_recorded_forces(visit, report, report_set):
    page = visit.open(report, fragment="#episode=4")
    expect(page.locator("#player-title")).to_have_text("Episode 4")
    frames = next(frames for frames in read_frames(DatasetFacts.read(report_set)) if frames.index == 4)
    page.locator("#scrub").fill("25")
    assert frames.interaction is not None
    robot, human = np.hypot(*frames.actions[25, :2]), np.hypot(*frames.actions[25, 2:])
    expect(page.locator("#player-readout")).to_contain_text(
        f"2.5 of {(len(frames.actions) - 1) / 10:.1f} s · robot seat ▲ {robot:.2f} · human seat ● {human:.2f} · "
        f"interaction {frames.interaction[25]:.2f}"
    )
    graph = page.locator("#graph").bounding_box()
    assert graph is not None
    page.mouse.click(graph["x"] + graph["width"] / 2, graph["y"] + graph["height"] / 2)
    middle = int(page.locator("#scrub").input_value())
    assert middle == pytest.approx((len(frames.actions) - 1) / 2, abs=1)


def test_a_line_of_a_trajectory_opens_its_episode(visit, report, report_set):
    page = visit.open(report)
    facts = DatasetFacts.read(report_set)
    target = next(iter(read_frames(facts)))
    page.get_by_role("searchbox", name="Find").fill(facts.episodes[0]["episode_uuid"])
    canvas = page.locator("#panels canvas").first
    box = canvas.bounding_box()
    assert box is not None
    x, y = target.states[len(target.states) // 2, :2] * box["width"] / 1200
    canvas.click(position={"x": float(x), "y": float(y)})
    expect(page.locator("#player-title")).to_have_text("Episode 0")
