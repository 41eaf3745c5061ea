"""`copolicy-dataset check` of a data set on the Hub, through the real client over HTTP."""

import json
from pathlib import Path

import pytest
from hub_user import HubUser
from local_hub import LocalHub
from versioned_data_set import simulated_data_set

from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def released(tmp_path_factory) -> Path:
    root = simulated_data_set(tmp_path_factory.mktemp("check") / "table")
    release(root, "major", "The first.")
    return root


@pytest.fixture(scope="module")
def user(tmp_path_factory, released):
    """A user who has published 1.0.0 with recordings as lab/table."""
    with LocalHub() as hub, HubUser(hub, tmp_path_factory.mktemp("home")) as user:
        done = user.run("publish", released, "--repo-id", "lab/table", "--raw", released.parent / "recordings")
        assert done.status == 0, done.err
        yield user
        assert not hub.faults


def findings(done) -> list[dict]:
    found = json.loads(done.out)["findings"]
    return [{name: value for name, value in finding.items() if name != "path"} for finding in found]


@pytest.mark.parametrize("revision", [(), ("--revision", "data-1.0.0"), ("--revision", "v3.0")])
def test_the_findings_equal_those_of_the_published_folder(user, released, revision):
    there = user.run("check", "lab/table", *revision, "--json")
    here = user.run("check", released, "--json", "--no-save")
    assert (there.status, findings(there)) == (here.status, findings(here))
    assert json.loads(there.out)["content_hash"] == json.loads(here.out)["content_hash"]


def test_recordings_are_not_downloaded_and_the_cache_is_not_changed(user):
    assert json.loads(user.run("check", "lab/table", "--json").out)["saved"] is None
    cached = [path for path in (user.home / "huggingface").rglob("*") if "snapshots" in path.parts]
    assert [path for path in cached if path.name == "info.json"]
    assert not [path for path in cached if path.suffix == ".mcap"]


@pytest.mark.parametrize(
    ("name", "flags", "message"),
    [
        ("lab/none", (), "lab/none: no such data set on the Hub, or a private one that the token cannot read"),
        ("lab/table", ("--revision", "data-9.0.0"), "lab/table@data-9.0.0: querying the Hub: no such revision"),
    ],
)
def test_a_missing_data_set_gives_one_line(user, name, flags, message):
    assert user.run("check", name, *flags).error == message


def test_a_failing_hub_gives_one_line_and_no_cached_copy_is_checked(user):
    assert user.run("check", "lab/table", "--json").status == 0  # and is in the client's cache
    user.hub.fail("GET", r"/api/datasets/lab/table", 503, times=20)
    error = user.run("check", "lab/table").error
    user.hub.faults.clear()
    trouble = "the Hub failed (HTTP 503); run the command again to continue"
    assert error == f"lab/table: querying the Hub: {trouble}"
    assert user.run("check", "lab/table", "--json").status == 0
