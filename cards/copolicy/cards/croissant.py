"""Croissant 1.0 metadata of a data set as JSON-LD, which search engines and loaders of other projects read.

The data lie in the repository on the Hub, described as one file object that is fetched with git, as the Hub's own
Croissant files have it; every file of the data is named in it with its sha256. A copy on the disk is read by naming its
folder: `mlcroissant.Dataset("meta/croissant.json", mapping={"repository": FOLDER})`.
Format: https://docs.mlcommons.org/croissant/docs/croissant-spec.html
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS
from copolicy.dataset.files.listing import visible_files

from .artefacts import newest_release
from .dataset_card import licence
from .facts import DatasetFacts

REPOSITORY = "repository"
"""Id of what the data files lie in; a reader maps it to a folder."""

_TYPES = {
    "float32": "sc:Float", "float64": "sc:Float", "int64": "sc:Integer", "bool": "sc:Boolean", "string": "sc:Text",
    "float": "sc:Float", "int": "sc:Integer", "str": "sc:Text",
}  # fmt: skip
_PICTURES = ("video", "image")
_TERMS = (
    "@language", "@vocab", "citeAs", "column", "conformsTo", "cr", "rai", "data", "dataType", "dct",
    "equivalentProperty", "examples", "extract", "field", "fileProperty", "fileObject", "fileSet", "format",
    "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex",
    "repeated", "replace", "samplingRate", "sc", "separator", "source", "subField", "transform",
)  # fmt: skip
_ELSEWHERE = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "sc": "https://schema.org/",
}
_CONTEXT = {name: _ELSEWHERE.get(name, f"cr:{name}") for name in _TERMS}
"""Croissant's terms are its own, but for those that are defined elsewhere."""


def croissant_text(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> str:
    """The JSON-LD: every data file with its hash, one record set of frames and one of episodes.

    Version and date of publication are those of the newest release, and left out where there is none.

    Raises:
        InvalidValueError: a licence that is not in the Hub's form.
    """
    return json.dumps(croissant_metadata(facts, repo_id, pretty_name), indent=1) + "\n"


def croissant_metadata(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> dict[str, Any]:
    """The same as a JSON-able dict."""
    release, words = newest_release(facts.root) or {}, facts.words
    url = f"https://huggingface.co/datasets/{repo_id}"
    metadata: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": pretty_name or repo_id.split("/")[1],
        "description": (
            f"{len(facts.episodes)} episodes of {words.episodes_of}; source: "
            f"{', '.join(facts.values('source'))}."
        ),
        "url": url,
        **({"citeAs": words.paper} if words.paper else {}),
        "keywords": ["robotics", "LeRobot", "human-robot collaboration", *facts.values("source")],
        "distribution": [_repository(url), *_file_set(facts.root, "frames", "data"),
                         *_file_set(facts.root, "episodes", "meta/episodes")],
        "recordSet": [_frames(facts), _episodes(facts)],
    }  # fmt: skip
    stated = licence(facts)
    if stated not in ("unknown", "other"):
        metadata["license"] = stated
    if "version" in release:
        metadata |= {"version": release["version"], "datePublished": release["date"]}
    return metadata


def _repository(url: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": REPOSITORY,
        "name": REPOSITORY,
        "description": "The data set's repository; the files in it have their own check sums.",
        "contentUrl": url,
        "encodingFormat": "git+https",
        # The format asks for a check sum of every file object; a repository has none, and this issue is what stands
        # in its place in the Croissant files of the Hub.
        "sha256": "https://github.com/mlcommons/croissant/issues/80",
    }


def _file_set(root: Path, name: str, folder: str) -> list[dict[str, Any]]:
    """A file set of the Parquet files in a folder, and each of them with its check sum."""
    parquet = "application/x-parquet"
    within = {"containedIn": {"@id": REPOSITORY}, "encodingFormat": parquet}
    files = {"@type": "cr:FileSet", "@id": f"{name}-files", "name": f"{name}-files", **within}
    return [{**files, "includes": f"{folder}/*/*.parquet"}, *(
        {"@type": "cr:FileObject", "@id": place, "name": place, "contentUrl": place, **within,
         "contentSize": f"{path.stat().st_size} B", "sha256": _sha256(path)}
        for path in visible_files(root / folder, "*.parquet")
        for place in (path.relative_to(root).as_posix(),)
    )]  # fmt: skip


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _frames(facts: DatasetFacts) -> dict[str, Any]:
    """The columns of the data files; pictures lie in files of their own."""
    fields = []
    for key, feature in facts.info["features"].items():
        if feature["dtype"] in _PICTURES:
            continue
        names = feature.get("names")
        field = _field("frames", key, feature["dtype"], ", ".join(map(str, names)) if isinstance(names, list) else key)
        if tuple(feature["shape"]) not in ((), (1,)):
            field["repeated"] = True
        fields.append(field)
    return {
        "@type": "cr:RecordSet",
        "@id": "frames",
        "name": "frames",
        "description": f"One record a frame, {facts.info['fps']:g} a second.",
        "key": {"@id": "frames/index"},
        "field": fields,
    }


def _episodes(facts: DatasetFacts) -> dict[str, Any]:
    columns = {"episode_index": "int", "length": "int", **EPISODE_COLUMNS}
    columns = {
        name: kind
        for name, kind in columns.items()
        if name in facts.folder.episodes.column_names or name not in LATER_COLUMNS
    }
    return {
        "@type": "cr:RecordSet",
        "@id": "episodes",
        "name": "episodes",
        "description": facts.words.record,
        "key": {"@id": "episodes/episode_index"},
        "field": [_field("episodes", name, kind, name.replace("_", " ")) for name, kind in columns.items()],
    }


def _field(records: str, column: str, kind: str, description: str) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"{records}/{column}",
        "name": f"{records}/{column}",
        "description": description,
        "dataType": _TYPES.get(kind, "sc:Text"),
        "source": {"fileSet": {"@id": f"{records}-files"}, "extract": {"column": column}},
    }
