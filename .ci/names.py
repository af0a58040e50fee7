#!/usr/bin/env python3
"""Prints type names that are defined more than twice, with the places, and exits with 1 if there are any.

    python3 .ci/names.py

It looks at structs, enums, unions, traits and free type aliases in all Rust sources. Associated types and `Error` do not count.
"""

import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MAX_TYPES = 2
DEFINITION = re.compile(r"^(\s*)(?:pub(?:\([^)]*\))? )?(?:unsafe )?(struct|enum|union|trait|type) (\w+)")


def definitions(text):
    """Yields the line number and the name of each definition. A type alias inside an `impl` or a `trait` is associated."""
    block = None
    for number, line in enumerate(text.splitlines(), 1):
        indent = len(line) - len(line.lstrip())
        if block is not None and line.strip() and indent <= block and line.strip() != "where":
            block = None
        if block is None and re.match(r"\s*(?:pub(?:\([^)]*\))? )?(?:unsafe )?(?:impl\b|trait )", line):
            block = indent
        found = DEFINITION.match(line)
        if found and found[3] != "Error" and not (found[2] == "type" and block is not None and indent > block):
            yield number, found[3]


def main():
    places = defaultdict(list)
    listed = subprocess.run(["git", "ls-files", "*.rs"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listed.stdout.split():
        for number, found in definitions((ROOT / name).read_text()):
            places[found].append(f"{name}:{number}")
    common = {name: where for name, where in places.items() if len(where) > MAX_TYPES}
    for name, where in sorted(common.items(), key=lambda item: -len(item[1])):
        print(f"{len(where):3} {name}: {', '.join(where)}")
    print(f"{len(places)} names, {len(common)} of them used for more than {MAX_TYPES} types")
    sys.exit(1 if common else 0)


main()
