"""Croissant 1.0 metadata of a data set as JSON-LD, which search engines and loaders of other projects read.

Format: https://docs.mlcommons.org/croissant/docs/croissant-spec.html
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from .artefacts import RELEASE_FILE, read_json
from .dataset_card import licence
from .facts import DatasetFacts

CROISSANT_FILE = Path("meta/croissant.json")

_TYPES = {
    "float32": "sc:Float", "float64": "sc:Float", "int64": "sc:Integer", "bool": "sc:Boolean", "string": "sc:Text",
}  # fmt: skip
_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}


def croissant_text(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> str:
    """The JSON-LD: every data file with its hash, and one record set of frames.

    Raises:
        InvalidValueError: a licence that is not in the Hub's form.
    """
    return json.dumps(croissant_metadata(facts, repo_id, pretty_name), indent=1) + "\n"


def croissant_metadata(facts: DatasetFacts, repo_id: str, pretty_name: str | None = None) -> dict[str, Any]:
    """The same as a JSON-able dict."""
    release = read_json(facts.root / RELEASE_FILE) or {}
    files = [_file(facts.root, path) for path in sorted((facts.root / "data").glob("*/*.parquet"))]
    metadata: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": pretty_name or repo_id.split("/")[1],
        "description": (
            f"{len(facts.episodes)} episodes of two players carrying a table; source: "
            f"{', '.join(facts.values('source'))}."
        ),
        "url": f"https://huggingface.co/datasets/{repo_id}",
        "keywords": ["robotics", "LeRobot", "human-robot collaboration", *facts.values("source")],
        "distribution": [
            *files,
            {
                "@type": "cr:FileSet",
                "@id": "frames-files",
                "name": "frames-files",
                "containedIn": [{"@id": file["@id"]} for file in files],
                "encodingFormat": "application/x-parquet",
                "includes": "data/*/*.parquet",
            },
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": "frames",
                "name": "frames",
                "field": [_field(key, feature) for key, feature in facts.info["features"].items()],
            }
        ],
    }
    stated = licence(facts)
    if stated not in ("unknown", "other"):
        metadata["license"] = stated
    if "version" in release:
        metadata |= {"version": release["version"], "datePublished": release["date"]}
    return metadata


def _file(root: Path, path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    name = path.relative_to(root).as_posix()
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "encodingFormat": "application/x-parquet",
        "contentSize": f"{path.stat().st_size} B",
        "sha256": digest,
    }


def _field(key: str, feature: dict[str, Any]) -> dict[str, Any]:
    names = feature.get("names")
    field: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": f"frames/{key}",
        "name": f"frames/{key}",
        "description": ", ".join(names) if isinstance(names, list) else key,
        "dataType": _TYPES.get(feature["dtype"], "sc:Text"),
        "source": {"fileSet": {"@id": "frames-files"}, "extract": {"column": key}},
    }
    if tuple(feature["shape"]) not in ((), (1,)):
        field["repeated"] = True
    return field
