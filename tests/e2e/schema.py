#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""schema.py SCHEMA FILE…: are the JSON files valid, and of a .log or "log" each line? Numbers that
JSON does not have are refused."""
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


def documents(name):
    with open(name, encoding="utf-8") as f:
        texts = f.readlines() if name.endswith("log") else [f.read()]
    return [json.loads(text, parse_constant=refuse, object_pairs_hook=pairs) for text in texts]


with open(sys.argv[1], encoding="utf-8") as f:
    rules = json.load(f)
jsonschema.Draft202012Validator.check_schema(rules)
validator = jsonschema.Draft202012Validator(rules)
errors = [(name, error) for name in sys.argv[2:] for value in documents(name)
          for error in validator.iter_errors(value)]
for name, error in errors:
    print(f"# {name}: {'/'.join(map(str, error.absolute_path))}: {error.message}"[:400])
sys.exit(1 if errors else 0)
