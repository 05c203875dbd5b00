#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""schema.py SCHEMA FILE: is the JSON file valid? Numbers that JSON does not have are refused."""
import json
import sys

import jsonschema


def refuse(name):
    raise ValueError(f"{name} is not JSON")


def pairs(items):
    names = [name for name, _ in items]
    if len(set(names)) != len(names):
        raise ValueError("a name is there twice")
    return dict(items)


schema, instance = sys.argv[1:]
with open(schema, encoding="utf-8") as f:
    rules = json.load(f)
with open(instance, encoding="utf-8") as f:
    value = json.load(f, parse_constant=refuse, object_pairs_hook=pairs)
jsonschema.Draft202012Validator.check_schema(rules)
errors = list(jsonschema.Draft202012Validator(rules).iter_errors(value))
for error in errors:
    print(f"# {instance}: {'/'.join(map(str, error.absolute_path))}: {error.message}"[:400])
sys.exit(1 if errors else 0)
