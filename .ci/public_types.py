"""Checks that pyright knows the type of every public name of the rooms: what is in `__all__`, with its attributes."""

import json
import subprocess
import sys
from importlib import import_module

ROOMS = ("dataset", "collect", "convert", "train", "evaluate", "cards")


def unknown_types(package: str) -> list[str]:
    """One line for each public symbol of a package whose type is not known."""
    command = ("pyright", "--verifytypes", package, "--ignoreexternal", "--outputjson")
    report = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)
    module = import_module(package)
    values = [getattr(module, name) for name in module.__all__]
    public = {f"{package}.{name}" for name in module.__all__} | {f"{x.__module__}.{x.__qualname__}" for x in values}
    symbols = report["typeCompleteness"]["symbols"]
    missing = {f"{package}.{name}" for name in module.__all__} - {symbol["name"] for symbol in symbols}
    return [f"{name}: not among the symbols that pyright reports" for name in sorted(missing)] + [
        f"{symbol['name']}: {' '.join(problem['message'].split())}"
        for symbol in symbols
        if not symbol["isTypeKnown"] and any(f"{symbol['name']}.".startswith(f"{name}.") for name in public)
        for problem in symbol["diagnostics"]
    ]


if __name__ == "__main__":
    lines = [line for room in sys.argv[1:] or ROOMS for line in unknown_types(f"copolicy.{room}")]
    print("\n".join(lines) or "every public name has a known type")
    sys.exit(bool(lines))
