"""The documents of the repository: links that lead somewhere, commands that exist, names that the code has."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from constructed_pairs import ONE, carried_set

from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.features import VECTORS
from copolicy.dataset.files import meta_files
from copolicy.dataset.recording.episode_records import COLUMNS_AT_END, COLUMNS_AT_START, RESULT
from copolicy.dataset.recording.generic_messages import messages_of
from copolicy.dataset.statistics.compute import compute_statistics
from copolicy.dataset.task import get_task

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / ".ci"))

from commands import blocks, commands  # noqa: E402  # pyright: ignore[reportMissingImports]

DOCUMENTS = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "*/*.md", "*/docs/*.md", "train/lerobot_policy_copolicy/pretrained/*.md")
    for path in ROOT.glob(pattern)
    if not path.relative_to(ROOT).as_posix().startswith(("outputs/", "tests/", "."))  # .: pytest writes one too
)
PROSE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
FORMAT = (ROOT / "dataset/docs/format.md").read_text(encoding="utf-8")


def anchors(path: Path) -> set[str]:
    """What the headings of a document are called in links, as GitHub does it."""
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_relative_link_leads_to_a_file_and_a_heading(name):
    document = ROOT / name
    text = PROSE.sub("", document.read_text(encoding="utf-8"))
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        linked = document.parent / path if path else document
        if not linked.exists() or (anchor and anchor not in anchors(linked)):
            broken.append(target)
    assert broken == []


def test_the_readme_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
    assert [line for line in lines if len(line) > 120] == []
    for image in re.findall(r"\.github/images/\S+?\.png", "\n".join(lines)):
        assert (ROOT / image).stat().st_size < 300_000


@pytest.mark.parametrize("name", [name for name in DOCUMENTS if "/docs/" in name or name == "README.md"])
def test_every_command_of_a_guide_is_run_or_says_why_not(name):
    for block in blocks((ROOT / name).read_text(encoding="utf-8")):
        if block.language != "bash":
            continue
        if block.kind == "not run":
            assert block.detail
            continue
        for command in commands(block):
            assert command.split()[0].startswith(("copolicy-", "lerobot-")), command


def test_a_command_is_taken_from_its_block_as_people_type_it():
    play = "copolicy-collect play \\\n  --players keyboard joystick"
    text = f"<!-- hub -->\n```bash\nuv run copolicy-dataset stats A   # why\n{play}\n```\n"
    (block,) = blocks(text)
    assert (block.kind, block.language) == ("hub", "bash")
    stats, play = commands(block)
    assert stats == "copolicy-dataset stats A"
    assert play.split() == "copolicy-collect play --players scripted scripted --headless --episodes 1".split()


def test_the_comment_of_a_block_ends_with_its_line():
    text = "<!-- not run: people -->\n```bash\na\n```\n<!-- file: b.json -->\n```json\n{}\n```\n"
    assert [(block.kind, block.detail) for block in blocks(text)] == [("not run", "people"), ("file", "b.json")]


def test_the_guide_to_the_format_names_everything_that_is_stored():
    messages = messages_of(get_task())
    names = {topic.name for topic in messages.topics} - {"/scene/solid/obstacle_1", "/scene/solid/obstacle_2"}
    names |= {topic.schema_name for topic in messages.topics}
    names |= {field.name for topic in messages.topics[:8] for field in topic.message.DESCRIPTOR.fields}
    names |= set(EPISODE_COLUMNS) | set(COLUMNS_AT_START) | {RESULT, *COLUMNS_AT_END} | set(VECTORS)
    stored = (meta_files.RECORD_FILE, meta_files.CHECK_FILE, meta_files.STATISTICS_FILE, meta_files.RELEASE_FILE)
    names |= {Path(file).name for file in (*stored, meta_files.MANIFEST_FILE, meta_files.WITHDRAWALS_FILE)}
    spec = get_task().spec
    names |= {*spec.state.names, *spec.joint_action.names, *spec.reasons}
    assert sorted(name for name in names if f"`{name}`" not in FORMAT) == []


def test_the_guide_to_the_format_defines_every_statistic():
    data = carried_set(["L", "R"] * 3, ONE, np.random.default_rng(0))
    document = compute_statistics(data, replicates=5)
    defined = FORMAT[FORMAT.index("## Statistics") :].replace("`..._player_1`", "`action_variance_ratio_player_1`")
    missing = [
        name
        for family in document["statistics"].values()
        for name in family
        if f"`{name}`" not in defined and not name.startswith("human_distance_")
    ]
    assert missing == []
