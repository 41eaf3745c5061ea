"""Licence identifiers of the Hub's cards.

The list is https://huggingface.co/docs/hub/repositories-licenses; the Hub rejects a card with any other identifier.
"""

import difflib
import re

from ..exceptions import InvalidValueError

LICENCES: dict[str, str] = {
    "apache-2.0": "Apache license 2.0",
    "mit": "MIT",
    "openrail": "OpenRAIL license family",
    "bigscience-openrail-m": "BigScience OpenRAIL-M",
    "creativeml-openrail-m": "CreativeML OpenRAIL-M",
    "bigscience-bloom-rail-1.0": "BigScience BLOOM RAIL 1.0",
    "bigcode-openrail-m": "BigCode Open RAIL-M v1",
    "afl-3.0": "Academic Free License v3.0",
    "artistic-2.0": "Artistic license 2.0",
    "bsl-1.0": "Boost Software License 1.0",
    "bsd": "BSD license family",
    "bsd-2-clause": "BSD 2-clause Simplified license",
    "bsd-3-clause": "BSD 3-clause New or Revised license",
    "bsd-3-clause-clear": "BSD 3-clause Clear license",
    "c-uda": "Computational Use of Data Agreement",
    "cc": "Creative Commons license family",
    "cc0-1.0": "Creative Commons Zero v1.0 Universal",
    "cc-by-2.0": "Creative Commons Attribution 2.0",
    "cc-by-2.5": "Creative Commons Attribution 2.5",
    "cc-by-3.0": "Creative Commons Attribution 3.0",
    "cc-by-4.0": "Creative Commons Attribution 4.0",
    "cc-by-sa-3.0": "Creative Commons Attribution Share Alike 3.0",
    "cc-by-sa-4.0": "Creative Commons Attribution Share Alike 4.0",
    "cc-by-nc-2.0": "Creative Commons Attribution Non Commercial 2.0",
    "cc-by-nc-3.0": "Creative Commons Attribution Non Commercial 3.0",
    "cc-by-nc-4.0": "Creative Commons Attribution Non Commercial 4.0",
    "cc-by-nd-4.0": "Creative Commons Attribution No Derivatives 4.0",
    "cc-by-nc-nd-3.0": "Creative Commons Attribution Non Commercial No Derivatives 3.0",
    "cc-by-nc-nd-4.0": "Creative Commons Attribution Non Commercial No Derivatives 4.0",
    "cc-by-nc-sa-2.0": "Creative Commons Attribution Non Commercial Share Alike 2.0",
    "cc-by-nc-sa-3.0": "Creative Commons Attribution Non Commercial Share Alike 3.0",
    "cc-by-nc-sa-4.0": "Creative Commons Attribution Non Commercial Share Alike 4.0",
    "cdla-sharing-1.0": "Community Data License Agreement Sharing 1.0",
    "cdla-permissive-1.0": "Community Data License Agreement Permissive 1.0",
    "cdla-permissive-2.0": "Community Data License Agreement Permissive 2.0",
    "wtfpl": "Do What The F*ck You Want To Public License",
    "ecl-2.0": "Educational Community License v2.0",
    "epl-1.0": "Eclipse Public License 1.0",
    "epl-2.0": "Eclipse Public License 2.0",
    "etalab-2.0": "Etalab Open License 2.0",
    "eupl-1.1": "European Union Public License 1.1",
    "eupl-1.2": "European Union Public License 1.2",
    "agpl-3.0": "GNU Affero General Public License v3.0",
    "gfdl": "GNU Free Documentation License family",
    "gpl": "GNU General Public License family",
    "gpl-2.0": "GNU General Public License v2.0",
    "gpl-3.0": "GNU General Public License v3.0",
    "lgpl": "GNU Lesser General Public License family",
    "lgpl-2.1": "GNU Lesser General Public License v2.1",
    "lgpl-3.0": "GNU Lesser General Public License v3.0",
    "isc": "ISC",
    "h-research": "H Research License",
    "intel-research": "Intel Research Use License Agreement",
    "lppl-1.3c": "LaTeX Project Public License v1.3c",
    "ms-pl": "Microsoft Public License",
    "apple-ascl": "Apple Sample Code license",
    "apple-amlr": "Apple Model License for Research",
    "mpl-2.0": "Mozilla Public License 2.0",
    "odc-by": "Open Data Commons License Attribution family",
    "odbl": "Open Database License family",
    "openmdw-1.0": "Open Model, Data & Weights License Agreement 1.0",
    "openmdw-1.1": "Open Model, Data & Weights License Agreement 1.1",
    "openrail++": "Open Rail++-M License",
    "osl-3.0": "Open Software License 3.0",
    "postgresql": "PostgreSQL License",
    "ofl-1.1": "SIL Open Font License 1.1",
    "ncsa": "University of Illinois/NCSA Open Source License",
    "unlicense": "The Unlicense",
    "zlib": "zLib License",
    "pddl": "Open Data Commons Public Domain Dedication and License",
    "lgpl-lr": "Lesser General Public License For Linguistic Resources",
    "deepfloyd-if-license": "DeepFloyd IF Research License Agreement",
    "fair-noncommercial-research-license": "FAIR Noncommercial Research License",
    "llama2": "Llama 2 Community License Agreement",
    "llama3": "Llama 3 Community License Agreement",
    "llama3.1": "Llama 3.1 Community License Agreement",
    "llama3.2": "Llama 3.2 Community License Agreement",
    "llama3.3": "Llama 3.3 Community License Agreement",
    "llama4": "Llama 4 Community License Agreement",
    "grok2-community": "Grok 2 Community License Agreement",
    "gemma": "Gemma Terms of Use",
    "unknown": "Unknown",
    "other": "Other",
}
"""Full name by identifier."""

_ALIASES = {  # spellings that `_normalised` does not map to an identifier
    "cc0": "cc0-1.0", "cczero": "cc0-1.0", "apache2": "apache-2.0", "gplv3": "gpl-3.0", "gplv2": "gpl-2.0",
    "bsd3": "bsd-3-clause", "bsd2": "bsd-2-clause", "odbl1": "odbl", "odcby1": "odc-by", "pddl1": "pddl",
    "cuda1": "c-uda", "expat": "mit", "gnugpl3": "gpl-3.0", "gnugpl2": "gpl-2.0", "gnulgpl3": "lgpl-3.0",
    "gnuagpl3": "agpl-3.0",
}  # fmt: skip
_ABBREVIATIONS = (
    ("creative commons", "cc"), ("attribution", "by"), ("non commercial", "nc"), ("noncommercial", "nc"),
    ("share alike", "sa"), ("sharealike", "sa"), ("no derivatives", "nd"), ("noderivatives", "nd"),
    ("noderivs", "nd"), ("international", ""), ("unported", ""), ("universal", ""), ("generic", ""),
    ("deed", ""), ("public license", ""), ("licence", ""), ("license", ""), ("version", ""), ("only", ""),
    ("or later", ""), ("the ", ""),
)  # fmt: skip


def checked_licence(text: str, name: str = "--license") -> str:
    """Returns a licence identifier unchanged, or an empty text, which states no licence.

    Args:
        name: flag or column, for the error message.

    Raises:
        InvalidValueError: not an identifier of the Hub; the message suggests one.
    """
    if not text or text in LICENCES:
        return text
    identifier = licence_identifier(text)
    if identifier is not None:
        raise InvalidValueError(name, f"{identifier}, as the Hub spells it", text)
    close = difflib.get_close_matches(re.sub(r"[\s_]+", "-", text.strip().lower()), LICENCES, n=3)
    nearest = f" such as {' or '.join(close or ('cc-by-4.0', 'cc0-1.0', 'mit'))}"
    raise InvalidValueError(
        name,
        f"a licence identifier of the Hub{nearest}, `other` for one that is not on its list "
        "(huggingface.co/docs/hub/repositories-licenses)",
        text,
    )


def licence_identifier(text: str) -> str | None:
    """The Hub's identifier for a licence in a common spelling; None if the text is not unambiguous."""
    if text in LICENCES:
        return text
    return _IDENTIFIERS.get(_normalised(text))


def _normalised(text: str) -> str:
    """Reduces a licence name to letters and digits of its significant words: `CC BY 4.0` equals `cc-by-4.0`."""
    text = re.sub(r"https?://(?:www\.)?creativecommons\.org/licenses/([a-z-]+)/([\d.]+).*", r"cc-\1-\2", text.lower())
    text = re.sub(r"https?://(?:www\.)?creativecommons\.org/publicdomain/zero/1\.0.*", "cc0-1.0", text)
    text = re.sub(r"[^a-z0-9.+]+", " ", text)
    for phrase, abbreviation in _ABBREVIATIONS:
        text = text.replace(phrase, f"{abbreviation} " if abbreviation else " ")
    text = re.sub(r"(?<=[ a-z])v(?:er)?\.? ?(?=\d)", "", text)
    # 4, 4.0 and 4.0.0 are one version.
    text = re.sub(r"(\d+(?:\.\d+)*?)(?:\.0)+(?![\d.])", r"\1", text)
    return re.sub(r"[ .]+", "", text)


_IDENTIFIERS = {
    **_ALIASES,
    **{_normalised(name): identifier for identifier, name in LICENCES.items()},
    **{_normalised(identifier): identifier for identifier in LICENCES},
}
