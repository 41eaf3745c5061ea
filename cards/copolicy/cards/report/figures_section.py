"""The section of the page with the figures of a folder, embedded as they are."""

import base64
from html import escape
from pathlib import Path

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.trajectory_figures import FIGURES_FILE, FiguresDocument

_EXPECTED = f"a folder with the {FIGURES_FILE} of copolicy-eval figures"
_TYPES = {".svg": "image/svg+xml", ".png": "image/png"}


def figures_section(folder: Path, task: str) -> str:
    """HTML of the section: the figures of `figures.json` with their definitions, then other images of the folder.

    Of a figure as SVG and PNG, the page has the SVG.

    Args:
        task: name of the task of the page's data set.

    Raises:
        FileFormatError: the folder has no such document, a figure that it names is missing, or it is of another task.
    """
    document = read_json(folder / FIGURES_FILE, FiguresDocument, _EXPECTED)
    if document["task"] != task:
        raise FileFormatError(folder / FIGURES_FILE, f"figures of the task {task}", document["task"])
    parts: list[str] = []
    listed: set[str] = set()
    for figure in document["figures"].values():
        files = [folder / Path(name).name for name in figure["files"]]
        listed.update(path.stem for path in files)
        parts.append(_figure(_best(folder, files), figure["title"], figure["definition"]))
    others = sorted({path.stem for path in folder.iterdir() if path.suffix in _TYPES and path.is_file()} - listed)
    for stem in others:
        files = [path for suffix in _TYPES if (path := folder / f"{stem}{suffix}").is_file()]
        parts.append(_figure(_best(folder, files), stem, f"not described in {FIGURES_FILE}"))
    sources = "".join(
        f"<li><strong>{escape(source['name'])}</strong>: {source['episodes']} episodes; {escape(source['label'])}</li>"
        for source in document["sources"]
    )
    return (
        '<section id="figures" aria-labelledby="figures-title">\n<h2 id="figures-title">Figures</h2>\n'
        "<p>Drawn by copolicy-eval; the filters do not change them. Sources:</p>\n"
        f"<ul>{sources}</ul>\n{''.join(parts)}</section>"
    )


def _best(folder: Path, files: list[Path]) -> Path:
    for suffix in _TYPES:
        for path in files:
            if path.suffix == suffix and path.is_file():
                return path
    raise FileFormatError(
        folder, "the SVG or PNG that its figures.json names", f"no {', '.join(p.name for p in files)}"
    )


def _figure(path: Path, title: str, definition: str) -> str:
    content = base64.b64encode(path.read_bytes()).decode()
    caption = f"<strong>{escape(title)}</strong>: {escape(definition)}"
    image = f'<img src="data:{_TYPES[path.suffix]};base64,{content}" alt="{escape(title)}">'
    return f'<figure class="embedded">{image}<figcaption>{caption}</figcaption></figure>\n'
