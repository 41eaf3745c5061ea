"""Where the settings of a user are: as each system has it, and where the first version left them."""

import sys
from pathlib import Path

import pytest

from copolicy.collect.inputs import user_config_folder


@pytest.mark.skipif(sys.platform != "linux", reason="the folder of Linux")
def test_the_folder_is_that_of_the_desktop_standard(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert user_config_folder() == tmp_path / "copolicy"
    monkeypatch.delenv("XDG_CONFIG_HOME")
    assert user_config_folder() == Path.home() / ".config" / "copolicy"


def test_what_lies_where_the_first_version_looked_on_macos_is_found(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("HOME", str(tmp_path))
    earlier = tmp_path / "Library" / "Application Support" / "copolicy"
    assert user_config_folder() == tmp_path / "config" / "copolicy"
    earlier.mkdir(parents=True)
    assert user_config_folder() == earlier
    (tmp_path / "config" / "copolicy").mkdir(parents=True)
    assert user_config_folder() == tmp_path / "config" / "copolicy"
