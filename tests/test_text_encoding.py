"""Texts, file names and terminals with other encodings."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from versioned_data_set import simulated_data_set

from copolicy.dataset.cli import main
from copolicy.dataset.command_line.commands import add_command, command_parser, run
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.text_files import read_legacy_text, read_text


def test_a_byte_order_mark_is_removed(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_bytes(b"\xef\xbb\xbfh\xc3\xa9llo")
    assert read_text(path) == "héllo"


def test_a_text_in_another_encoding_is_refused(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_bytes("héllo".encode("latin-1"))
    with pytest.raises(FileFormatError) as error:
        read_text(path)
    assert str(error.value) == f"{path}: expected UTF-8 text, found the byte 0xe9 at position 1"
    assert read_legacy_text(path) == "héllo"


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8-sig", "utf-8"])
def test_a_change_log_in_another_encoding_survives_a_release(tmp_path, encoding, capsys):
    root = simulated_data_set(tmp_path / "set")
    (root / "CHANGELOG.md").write_bytes("# Änderungen\n\n## [Unreleased]\n- Café\n".encode(encoding))
    assert main(["release", str(root), "--bump", "minor", "--notes", "first"]) == 0
    text = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    assert text.startswith("# Änderungen\n")
    assert "- Café\n" in text
    assert "## [0.1.0]" in text


def test_characters_that_the_terminal_cannot_encode_are_escaped(monkeypatch):
    parser, commands = command_parser("tool", "A tool.")
    add_command(commands, "do", lambda arguments: {"success": "50 ± 3 %", "file": os.fsdecode(b"a\xff")}, "does", "x")
    printed = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="strict")
    monkeypatch.setattr(sys, "stdout", printed)
    assert run(parser, ["do"]) == 0
    printed.flush()
    assert printed.buffer.getvalue() == b"success  50 \\xb1 3 %\nfile     a\\udcff\n"  # type: ignore[attr-defined]


@pytest.mark.parametrize("settings", [{"LC_ALL": "C", "PYTHONUTF8": "0"}, {"PYTHONIOENCODING": "ascii"}])
def test_names_of_other_encodings_under_any_locale(tmp_path, settings):
    folder = Path(os.fsdecode(bytes(tmp_path) + b"/caf\xe9 \xc3\xa9"))
    script = "import sys; from copolicy.dataset.cli import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", script, "check", folder], capture_output=True, env={**os.environ, **settings}
    )
    assert done.returncode == 2
    assert done.stderr.startswith(b"copolicy-dataset: ")
    assert done.stderr.count(b"\n") == 1
