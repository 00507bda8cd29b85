"""The JSON Schema of `case.toml`, made from the tables that it is read by.

Editors that know Taplo complete and check with it what a person types: ``warpbrain cases schema > case.schema.json``,
and ``#:schema case.schema.json`` on the first line of a case. It says what a file may say; what its words mean together
with the mesh, only reading the case can tell.
"""

import math
from collections.abc import Collection
from typing import Any

from warpbrain.cases.format.tables import PRIOR, TABLES, TISSUE
from warpbrain.keys import Key, Table
from warpbrain.physics.laws import LAWS
from warpbrain.problems import CONTROL

_NUMBER = {"type": "number"}
_KINDS: dict[str, dict[str, Any]] = {
    "text": {"type": "string", "not": {"pattern": CONTROL}},
    "file": {"type": "string", "minLength": 1, "not": {"pattern": CONTROL}},
    "number": _NUMBER,
    "vector": {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3},
    "numbers": {"type": "array", "items": _NUMBER},
    "pairs": {"type": "array", "items": {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}},
}


def case_schema() -> dict[str, Any]:
    """The schema (JSON Schema, draft 2020-12)."""
    properties = {table.name: _table(table) for table in TABLES}
    for law, variant in zip(TISSUE.variants, properties["tissue"]["oneOf"], strict=True):
        # a tissue has all parameters of its law, or leaves them to the generative model
        given = {"required": list(LAWS[law].keys), "properties": {"mu": {"not": {"const": PRIOR}}}}
        variant["anyOf"] = [given, {"required": ["mu", "prior"], "properties": {"mu": {"const": PRIOR}}}]
    properties["tissue"] = {
        "type": "object",
        "description": TISSUE.doc,
        "patternProperties": {"^(0|[1-9][0-9]{0,9})$": properties["tissue"]},
        "additionalProperties": False,
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "case.toml of warpbrain",
        "description": "One folder is one case: an anatomy, what is assumed to act on it, and what was recorded.",
        "type": "object",
        "properties": properties,
        "required": ["case", "tissue"],
        # a specimen has a shape in the place of a mesh
        "oneOf": [{"required": ["mesh"]}, {"required": ["specimen"]}],
        "additionalProperties": False,
    }


def _table(table: Table) -> dict[str, Any]:
    if table.by is None:
        schema = _variant(table, "")
    else:
        schema = {"oneOf": [_variant(table, name) for name in table.variants]}
    schema["description"] = table.doc
    return {"type": "array", "items": schema, "description": table.doc} if table.several else schema


def _object(keys: Collection[Key]) -> dict[str, Any]:
    properties = {key.name: _key(key) for key in keys}
    required = [key.name for key in keys if key.needed]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _variant(table: Table, name: str) -> dict[str, Any]:
    schema = _object(table.keys_of(name).values())
    properties, required = schema["properties"], schema["required"]
    if table.by is not None:
        properties[table.by.name]["enum"] = [name]
        if name != table.by.default and table.by.name not in required:
            required.append(table.by.name)
    return schema


def _key(key: Key) -> dict[str, Any]:
    kinds: list[dict[str, Any]] = [_object(key.keys) if kind == "table" else dict(_KINDS[kind]) for kind in key.kinds]
    for kind in kinds:
        if kind["type"] == "string" and key.choices:
            kind["enum"] = list(key.choices)
        if kind["type"] == "number":
            if math.isfinite(key.above):
                kind["exclusiveMinimum"] = key.above
            if math.isfinite(key.below):
                kind["exclusiveMaximum"] = key.below
    schema: dict[str, Any] = kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    schema["description"] = key.described()
    return schema
