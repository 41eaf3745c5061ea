"""LeRobot's plugins: installed packages with policies, robots and environments, this one among them."""

import functools


@functools.cache
def register_plugins() -> None:
    """Imports all of them, once a process: finding them opens the metadata of every installed package."""
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
