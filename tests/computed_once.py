"""What LeRobot's libraries work out anew at each call, worked out once: half of the time of a short training."""

import functools
import sys
from typing import Any

import pytest


def computed_once(patch: pytest.MonkeyPatch) -> None:
    """Patches what has been imported."""
    if "draccus" in sys.modules:
        _parsers(patch)
    if "datasets" in sys.modules:
        _columns(patch)


def _parsers(patch: pytest.MonkeyPatch) -> None:
    """The parser of a class of settings: it has flags for all kinds of policies, environments and cameras."""
    from draccus import ChoiceRegistry, argparsing
    from draccus.wrappers import docstring

    patch.setattr(docstring, "get_attribute_docstring", functools.cache(docstring.get_attribute_docstring))
    build = argparsing.ArgumentParser.__init__
    parsers: dict[Any, Any] = {}

    def init(self: Any, config_class: type, config_path: Any = None, **options: Any) -> None:
        kinds = [name for registry in ChoiceRegistry.__subclasses__() for name in registry.get_known_choices()]
        key = (config_class, *options.items(), sys.argv[0], *kinds)
        if key not in parsers or {"--help", "-h"} & set(sys.argv):  # for its help it needs defaults and types
            build(self, config_class, None, **options)
            parsers[key] = self.parser
        vars(self).update(
            parser=parsers[key], config_class=config_class, config_path=config_path, constructor_arguments={}
        )

    patch.setattr(argparsing.ArgumentParser, "__init__", init)


def _columns(patch: pytest.MonkeyPatch) -> None:
    """Which columns must be decoded: `datasets` looks at all of them, up to 300, whenever one is set."""
    from datasets.features import features

    def set_column(self: Any, column: str, feature: Any) -> None:
        dict.__setitem__(self, column, feature)
        self._column_requires_decoding[column] = features.require_decoding(feature)

    patch.setattr(features.Features, "__setitem__", set_column)
