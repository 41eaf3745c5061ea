"""The findings that `copolicy-dataset check` keeps in a data set, and what a release and the checks make of them."""

import datetime
import json
import logging
import shutil

import pytest
from checked_data import contents, make_data_set, make_recordings, set_columns
from own_permissions import permissions_apply

from copolicy.dataset.checks.check_report import check_document, content_hash, validity
from copolicy.dataset.checks.checking import check_dataset, rules_of
from copolicy.dataset.checks.limits import RULES_VERSION, limits_of
from copolicy.dataset.cli import main
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.files.meta_files import CHECK_FILE
from copolicy.dataset.task import get_task
from copolicy.dataset.transfer.publish import verify_release
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.digests import digest
from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def converted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    return make_data_set(make_recordings(folder / "recordings", 3), folder / "set")


@pytest.fixture
def root(converted, tmp_path):
    return shutil.copytree(converted, tmp_path / "set")


def stored(root) -> dict:
    return json.loads((root / CHECK_FILE).read_text(encoding="utf-8"))


def test_findings_are_kept_with_rules_limits_date_and_content(root, capsys):
    before = contents(root), read_content(root).hash
    set_columns(root, license=["CC-BY-4.0", "CC-BY-4.0", "CC0-1.0"])
    changed = read_content(root).hash
    assert main(["check", str(root), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    document = stored(root)
    assert {name: printed[name] for name in document} == document
    assert printed["saved"] == str(root / CHECK_FILE)
    assert (document["schema"], document["rules_version"]) == ("copolicy-check-1", RULES_VERSION)
    assert document["limits"]["jump"] == {"value": 52.0, "unit": "px/s", "reason": limits_of(get_task())["jump"].reason}
    moment = datetime.datetime.fromisoformat(document["date"])
    assert abs(datetime.datetime.now(datetime.UTC) - moment) < datetime.timedelta(minutes=10)
    assert str(root) not in (root / CHECK_FILE).read_text(encoding="utf-8")
    assert document["counts"]["warning"] == 1
    assert [entry["rule"] for entry in document["findings"] if entry["severity"] == "warning"] == ["license"]
    # Neither the findings nor their renewal are part of the content.
    assert document["content_hash"] == changed == read_content(root).hash != before[1]
    assert set(contents(root)) == {*before[0], CHECK_FILE}


def test_findings_are_those_of_the_data_alone(root, tmp_path, capsys):
    other = shutil.copytree(root, tmp_path / "other")
    assert main(["check", str(root), "--against", str(other), "--strict"]) == 1
    assert "error: leakage: episode 0 of set: same episode_uuid as episode 0 of other" in capsys.readouterr().out
    assert (stored(root)["counts"]["error"], stored(root)["passed"], stored(root)["strict"]) == (0, True, False)
    assert not (other / CHECK_FILE).exists()


def test_nothing_is_kept_where_it_is_not_wanted(root, converted, capsys):
    recordings = converted.parent / "recordings"
    assert main(["check", str(root), "--no-save", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["saved"], printed["content_hash"]) == (None, read_content(root).hash)
    before = contents(recordings)
    assert main(["check", str(recordings), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["kind"], printed["saved"], printed["content_hash"]) == ("recordings", None, None)
    assert not (root / CHECK_FILE).exists()
    assert contents(recordings) == before


@pytest.mark.parametrize("status", [0, 1])
def test_a_folder_that_refuses_the_file_gives_one_warning_and_the_same_status(root, capsys, caplog, status):
    (root / CHECK_FILE).mkdir()  # a rename onto a folder fails for every user, root included
    if status:
        set_columns(root, source=["human"] * 3)
    assert main(["check", str(root)]) == status
    warnings = [record.getMessage() for record in caplog.records]
    assert len(warnings) == 1
    assert warnings[0].startswith(f"warning: {root / CHECK_FILE}: the findings were not written: ")
    assert warnings[0].endswith("; --no-save does not try")
    out = capsys.readouterr().out
    assert "passed       " + str(not status) in out
    assert "saved" not in out
    assert [path.name for path in (root / "meta").iterdir() if path.name.startswith(".")] == []


def test_a_read_only_folder_is_checked(root, monkeypatch, capsys):
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # pytest's, without which warnings go to stderr
    (root / "meta").chmod(0o500)
    try:
        with permissions_apply():
            assert main(["check", str(root)]) == 0
    finally:
        (root / "meta").chmod(0o700)
    where = f"warning: {root / CHECK_FILE}: the findings were not written"
    assert capsys.readouterr().err == f"{where}: Permission denied; --no-save does not try\n"
    assert not (root / CHECK_FILE).exists()


def test_damaged_data_are_checked_without_a_content_hash(root, capsys):
    data = next((root / "data").glob("*/*.parquet"))
    data.write_bytes(data.read_bytes()[:-10])
    assert content_hash(root) is None
    assert main(["check", str(root)]) == 1
    assert stored(root)["content_hash"] is None
    assert validity(stored(root), None).state == "unknown"


def test_findings_that_no_longer_hold_are_told_apart(root):
    result = check_dataset(root)
    content = content_hash(root)
    document = check_document(result, content)
    assert validity(document, content) == validity(document, content_hash(root))
    assert validity(document, content).state == "current"
    set_columns(root, discarded=[True, False, False])
    changed = validity(document, content_hash(root))
    assert (changed.state, changed.reason) == ("stale", "The content of the data set changed since it was checked.")
    older = validity({**document, "rules_version": "0.9.0"}, content)
    reason = f"They were made by version 0.9.0 of the rules; these are {RULES_VERSION}."
    assert (older.state, older.reason) == ("stale", reason)
    assert validity(document, None).state == "unknown"
    # What `check --json` printed before it named the content.
    before = validity({"rules": 37, "findings": []}, content)
    assert (before.state, before.reason.split(":")[0]) == ("unknown", "They do not say which content was checked")


def test_checking_again_is_no_change_to_a_release(root, capsys):
    release(root, "minor", "the first")
    for _ in range(2):  # not in the manifest, then in the folder for the second time
        assert main(["check", str(root), "--strict"]) == 0
    with pytest.raises(RunError, match=r"expected a change since release 0.1.0, found none"):
        release(root, "patch", "nothing new")
    (root / "README.md").write_text("---\nlicense: cc-by-4.0\n---\n", encoding="utf-8")
    record, manifest = verify_release(root)
    assert record.version == "0.1.0"
    # What goes up holds the findings, so that a manifest without them would be refused after a pull.
    assert CHECK_FILE in manifest.files
    assert main(["diff", f"{root}@0.1.0", str(root)]) == 0
    (root / "meta" / "stats.json").write_text("{}", encoding="utf-8")
    assert main(["check", str(root)]) == 1
    assert "error: check_sum: meta/stats.json has other content" in capsys.readouterr().out


def test_the_version_of_the_rules_follows_them():
    """A new rule, limit or severity asks for a new RULES_VERSION, and for its digest here."""
    rules = [[rule.name, rule.what] for rule in rules_of(get_task())]
    limits = {name: [float(limit.value), limit.unit] for name, limit in limits_of(get_task()).items()}
    assert (RULES_VERSION, digest({"rules": rules, "limits": limits})[:16]) == ("1.3.0", "99983c876367b2fa")
