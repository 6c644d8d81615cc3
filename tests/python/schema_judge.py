"""What a JSON Schema says of TOML files, by the package jsonschema: schema_judge.py SCHEMA < FILES.

Each line of standard input is a JSON string, the text of a file. Answers a line each: `ok`, `not TOML`, or what is
wrong and where.
"""

import json
import sys
import tomllib

import jsonschema


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        schema = json.load(file)
    judge = jsonschema.validators.validator_for(schema)
    assert judge is jsonschema.Draft7Validator, "the draft the schema names"
    judge.check_schema(schema)
    validator = judge(schema)
    for line in sys.stdin:
        try:
            document = tomllib.loads(json.loads(line))
        except tomllib.TOMLDecodeError:
            print("not TOML")
            continue
        error = jsonschema.exceptions.best_match(validator.iter_errors(document))
        print("ok" if error is None else f"{error.json_path}: {error.message}".replace("\n", " "))


if __name__ == "__main__":
    main()
