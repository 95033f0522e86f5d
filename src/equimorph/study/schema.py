"""JSON schema of study files, with which editors complete and check TOML.

``python -m equimorph.study.schema > docs/study.schema.json`` writes it. Types come from the
sections that read studies, words from the docstrings of the tasks and structures. What only holds
between several keys, or for names of a structure, is told by ``equimorph check``.
"""

import json
import sys
from collections.abc import Mapping
from typing import Any

from equimorph.structures import KINDS as STRUCTURES
from equimorph.study.fields import Section
from equimorph.study.kinds import KINDS
from equimorph.study.lookup import RuleSection
from equimorph.study.problem import STUDY, PointSection, SetSection
from equimorph.study.reference import meanings, meanings_of_kind, meanings_of_set
from equimorph.study.states import NaturalSection, StateSection
from equimorph.study.structures import (
    PARTS,
    SECTIONS,
    DrawnForceSection,
    DrawnSupportSection,
    EffectSection,
    ParameterSection,
    SpatialEffectSection,
)

TITLE = "equimorph study"
"""Title of the schema."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"
UNUSED = ("title", "discriminator")
"""Words that pydantic writes and editors have no use for."""
WORDS: Mapping[type[Section], Mapping[str, str]] = {
    STUDY: {
        "title": "Title of the page.",
        "structure": "The structure; its other keys depend on its kind.",
        "set": "The part of the equilibrium set to compute.",
        "equilibria": "Points of which all equilibria are listed.",
    },
    PointSection: {"at": "Values of the free parameters."},
    StateSection: {
        "at": "Values of the free parameters over which the state lies.",
        "highest": "Descriptor that is largest in the state.",
        "lowest": "Descriptor that is smallest in the state.",
        "near": "Descriptor with its value in the state.",
    },
    NaturalSection: {
        "at": "Values of parameters of the natural state.",
        "steps": "Values of parameters to which the state is lifted, step by step.",
    },
    RuleSection: {
        "highest": "Prefer the state in which this descriptor is largest.",
        "lowest": "Prefer the state in which this descriptor is smallest.",
        "quasi_static": "Prefer the state on the path along which this load grows.",
        "first_stable_on_path": "Prefer the first stable state on the path of this load.",
        "bound": "Largest load up to which the path is followed.",
    },
    ParameterSection: {
        "name": "Symbol of the parameter in the formulas.",
        "unit": "Its unit.",
        "scale": "Typical size of a change of the parameter; positive.",
        "role": "Whether it is steered, given by the environment, or fixed.",
        "default": "Value where none is given.",
        "lower": "Smallest value that has a meaning.",
        "upper": "Largest value that has a meaning.",
    },
    DrawnSupportSection: {
        "point": "Number of a point of `draw`, counted from 0.",
        "kind": "Kind of support.",
        "angle": "Direction of the support, radians.",
    },
    DrawnForceSection: {
        "point": "Number of a point of `draw`, counted from 0.",
        "force": "Components (x, y), as formulas.",
    },
    EffectSection: {
        "curvature": "Changes of intrinsic curvatures by member.",
        "length": "Changes of lengths by member.",
        "move": "Displacements (x, y) of supports by joint.",
        "turn": "Rotations of supports by joint, radians.",
    },
    SpatialEffectSection: {
        "curvature": "Changes of twist and of intrinsic curvatures about n and b by member.",
        "length": "Changes of lengths by member.",
        "move": "Displacements (x, y, z) of supports by joint.",
        "turn": "Rotations (x, y, z) of supports by joint, radians.",
    },
}
"""Meanings of keys that no docstring of a public function tells."""


def study_schema() -> dict[str, Any]:
    """Return the JSON schema of study files."""
    schema = STUDY.model_json_schema(by_alias=True)
    definitions = schema["$defs"]
    for section, told in _meanings_of_keys().items():
        node = schema if section is STUDY else definitions.get(section.__name__)
        for key, entry in (node or {}).get("properties", {}).items():
            if key in told and "description" not in entry:
                entry["description"] = told[key].replace("\\|", "|")
    return {"$schema": DIALECT, "title": TITLE, **_tidy(schema)}


def schema_text() -> str:
    """Return the schema as it is written into files."""
    return json.dumps(study_schema(), indent=1, ensure_ascii=False) + "\n"


def _meanings_of_keys() -> dict[type[Section], Mapping[str, str]]:
    """Return what the keys of all sections mean."""
    tables = {kind.table: (kind.__doc__ or "").strip() for kind in KINDS}
    told: dict[type[Section], Mapping[str, str]] = {
        section: meanings(part) for section, part in PARTS.items()
    }
    told |= {SetSection: meanings_of_set()}
    for kind in KINDS:
        told[kind.section] = {"name": "Names of its files begin with it."} | meanings_of_kind(kind)
    for word, section in SECTIONS.items():
        told[section] = {"kind": "Kind of structure."} | meanings(STRUCTURES[word])
    for keyed, words in WORDS.items():
        told[keyed] = {**told.get(keyed, {}), **words}
    told[STUDY] = {**told[STUDY], **tables}
    return told


def _tidy(node: Any, *, named: bool = False) -> Any:
    """Return a schema without the titles of pydantic, and without null, which TOML has not.

    `named`: whether the keys of this part are names of the study, not words of the schema.
    """
    if isinstance(node, list):
        return [_tidy(each) for each in node]
    if not isinstance(node, dict):
        return node
    if named:
        return {name: _tidy(inner) for name, inner in node.items()}
    content = {word: inner for word, inner in node.items() if word not in UNUSED}
    if content.get("default", 0) is None:
        del content["default"]
    options = [each for each in content.get("anyOf", []) if each != {"type": "null"}]
    if len(options) == 1:
        del content["anyOf"]
        content = {**options[0], **content}
        content.pop("title", None)
    elif options:
        content["anyOf"] = options
    tables = ("properties", "$defs")
    return {word: _tidy(inner, named=word in tables) for word, inner in content.items()}


if __name__ == "__main__":
    sys.stdout.write(schema_text())
