"""A file of maps for tests: two obstacles of different sizes, two orientations, a weight, splits."""

from pathlib import Path

LAB = """\
name: lab-doors
version: 1
author: The lab
license: cc-by-4.0
maps:
  - name: wide
    start: {x: 240, y: 300, theta: 180deg}
    goal: {x: 960, y: 300}
    obstacles:
      - {x: 600, y: 100, size: 120}
      - {x: 600, y: 500, size: 60}
    weight: 2
  - name: turned
    start: {x: 240, y: 300, orientations: [0deg, 90deg]}
    goal: {x: 960, y: 300}
    obstacles: [{x: 600, y: 300, size: 45}]
  - start: {x: 240, y: 300, theta: 3.14}
    goal: {x: 960, y: 420}
splits:
  train: [wide, turned]
  test: [2]
"""


def write_lab(folder: Path, old: str = "", new: str = "", name: str = "lab.yaml") -> Path:
    """The file, with one text in it replaced."""
    assert old in LAB
    path = folder / name
    path.write_text(LAB.replace(old, new, 1) if old else LAB, encoding="utf-8")
    return path
