"""Croissant 1.0 metadata of a data set as JSON-LD, for search engines and loaders of other projects.

The Hub repository is one file object fetched with git, as in the Hub's own Croissant files; every data file is listed
in it with its sha256. To read a local copy:
`mlcroissant.Dataset("meta/croissant.json", mapping={"repository": FOLDER})`.
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
"""Id of the file object that contains the data files; a reader maps it to a folder."""

_TYPES = {
    "float32": "sc:Float", "float64": "sc:Float", "int64": "sc:Integer", "bool": "sc:Boolean", "string": "sc:Text",
    "float": "sc:Float", "int": "sc:Integer", "str": "sc:Text",
}  # fmt: skip
_IMAGES = ("video", "image")
_TERMS = (
    "@language", "@vocab", "citeAs", "column", "conformsTo", "cr", "rai", "data", "dataType", "dct",
    "equivalentProperty", "examples", "extract", "field", "fileProperty", "fileObject", "fileSet", "format",
    "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex",
    "repeated", "replace", "samplingRate", "sc", "separator", "source", "subField", "transform",
)  # fmt: skip
_OTHER_TERMS = {
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
_CONTEXT = {name: _OTHER_TERMS.get(name, f"cr:{name}") for name in _TERMS}
"""Terms in the namespace of Croissant, except those of other vocabularies."""


def croissant_text(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> str:
    """Renders the JSON-LD: every data file with its hash, one record set of frames and one of episodes.

    Version and date of publication are those of the newest release, absent without a release.

    Raises:
        InvalidValueError: a licence that is not in the Hub's form.
    """
    return json.dumps(croissant_metadata(facts, repo_id, pretty_name), indent=1) + "\n"


def croissant_metadata(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> dict[str, Any]:
    """The content of `croissant_text` as a JSON-able dict."""
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
    identifier = licence(facts)
    if identifier not in ("unknown", "other"):
        metadata["license"] = identifier
    if "version" in release:
        metadata |= {"version": release["version"], "datePublished": release["date"]}
    return metadata


def _repository(url: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileObject",
        "@id": REPOSITORY,
        "name": REPOSITORY,
        "description": "The data set's repository; each file in it has its own check sum.",
        "contentUrl": url,
        "encodingFormat": "git+https",
        # The format requires a check sum of every file object. A repository has none; the Hub's own Croissant files
        # put this issue in its place.
        "sha256": "https://github.com/mlcommons/croissant/issues/80",
    }


def _file_set(root: Path, name: str, folder: str) -> list[dict[str, Any]]:
    """A file set of the Parquet files in a folder, and a file object with check sum for each of them."""
    parquet = "application/x-parquet"
    within = {"containedIn": {"@id": REPOSITORY}, "encodingFormat": parquet}
    files = {"@type": "cr:FileSet", "@id": f"{name}-files", "name": f"{name}-files", **within}
    return [{**files, "includes": f"{folder}/*/*.parquet"}, *(
        {"@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": name, **within,
         "contentSize": f"{path.stat().st_size} B", "sha256": _sha256(path)}
        for path in visible_files(root / folder, "*.parquet")
        for name in (path.relative_to(root).as_posix(),)
    )]  # fmt: skip


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _frames(facts: DatasetFacts) -> dict[str, Any]:
    """The columns of the data files; images are in separate files."""
    fields = []
    for key, feature in facts.info["features"].items():
        if feature["dtype"] in _IMAGES:
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
        "description": f"One record per frame, {facts.info['fps']:g} per second.",
        "key": {"@id": "frames/index"},
        "field": fields,
    }


def _episodes(facts: DatasetFacts) -> dict[str, Any]:
    columns = {"episode_index": "int", "length": "int", **EPISODE_COLUMNS}
    columns = {
        name: dtype
        for name, dtype in columns.items()
        if name in facts.folder.episodes.column_names or name not in LATER_COLUMNS
    }
    return {
        "@type": "cr:RecordSet",
        "@id": "episodes",
        "name": "episodes",
        "description": facts.words.record,
        "key": {"@id": "episodes/episode_index"},
        "field": [_field("episodes", name, dtype, name.replace("_", " ")) for name, dtype in columns.items()],
    }


def _field(record_set: str, column: str, dtype: str, description: str) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"{record_set}/{column}",
        "name": f"{record_set}/{column}",
        "description": description,
        "dataType": _TYPES.get(dtype, "sc:Text"),
        "source": {"fileSet": {"@id": f"{record_set}-files"}, "extract": {"column": column}},
    }
