"""Names of withdrawn episodes and people in texts and files."""

from copolicy.dataset.edit.withdrawal import traces as traces_module
from copolicy.dataset.edit.withdrawal.traces import Traces


def test_names_match_whole_words():
    traces = Traces(frozenset({"C-1", "P01", "12"}), frozenset({"episode_001.mcap"}))
    assert traces.redact("C-1 and C-10, P01-a, P01, P012, 12") == "(withdrawn) and C-10, P01-a, (withdrawn), P012, 12"
    assert traces.redact_json({"P01": 1, "asked": ["C-1", "12", "13"], "id": "12", "text": "by P01"}) == {
        "asked": ["13"],
        "id": "(withdrawn)",
        "text": "by (withdrawn)",
    }


def test_a_name_across_chunks_of_a_long_file_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(traces_module, "_CHUNK_SIZE", 7)
    traces = Traces(frozenset({"C-1", "P01-long-name"}))
    for number in range(40):
        path = tmp_path / f"{number}.txt"
        path.write_text("x" * number + " P01-long-name" + " y" * 9, encoding="utf-8")
        (tmp_path / f"{number}-no.txt").write_text("x" * number + " P01-long-names" + " yC-1 " * 9, encoding="utf-8")
    assert {path.name for path in traces.matching_files(tmp_path)} == {f"{number}.txt" for number in range(40)}
