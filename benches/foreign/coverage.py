"""Reports how well glimt reads scenes from other renderers, with one row per scene in the given folders.

    python3 benches/foreign/coverage.py [--glimt target/release/glimt] [-D NAME=VALUE] FOLDER...

Each scene is checked twice, with and without --strict. The result is one of

    opens          without any warning
    notes          opens, with notes about features that glimt defines differently
    substitution   opens, but features without an equivalent are replaced
    incomplete     an asset is missing
    parameter      a parameter has no value in the file (set it with -D)
    refused        any other error

followed by the reasons. Files without a sensor and files that other files include are only parts of scenes and are skipped, as are XML
files that are not Mitsuba scenes. The last line counts the complete files: all except incomplete ones and those without a parameter.
"""

import argparse
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

MISSING = re.compile(r"not found|Git LFS pointer|cannot read|no such file", re.IGNORECASE)
UNDEFINED = re.compile(r"undefined parameter")
INCLUDE = re.compile(r"<include[^>]*filename\s*=\s*[\"']([^\"']+)")


def is_whole_scene(path, seen=()):
    """Whether a file is a scene rather than a part of one: a pbrt file with `WorldBegin`, or a Mitsuba file that has a
    sensor or includes a file that has one."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix == ".pbrt":
        return bool(re.search(r"^\s*WorldBegin", text, re.MULTILINE))
    if "<scene" not in text:
        return False
    if re.search(r"<(sensor|camera)\b", text):
        return True
    for name in INCLUDE.findall(text):
        inner = path.parent / name
        if inner.is_file() and inner not in seen and is_whole_scene(inner, (*seen, path)):
            return True
    return False


def included_files(files):
    """Returns the XML files that other files include."""
    included = set()
    for path in files:
        if path.suffix == ".xml":
            for name in INCLUDE.findall(path.read_text(encoding="utf-8", errors="replace")):
                included.add((path.parent / name).resolve())
    return included


def check(glimt, path, options):
    """Runs `glimt check`. Returns its exit code and diagnostics."""
    command = [glimt, "check", "--json", *options, str(path)]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=600)
    except subprocess.TimeoutExpired:
        return -1, [{"severity": "error", "message": "timeout"}]
    try:
        return run.returncode, json.loads(run.stdout)["diagnostics"]
    except (json.JSONDecodeError, KeyError):
        message = run.stderr.strip().splitlines() or ["no output"]
        return run.returncode, [{"severity": "error", "message": message[0]}]


def classify(glimt, path, options):
    """Returns the result for a scene, and its reasons."""
    code, found = check(glimt, path, options)
    errors = [one["message"] for one in found if one["severity"] == "error"]
    if code != 0:
        if errors and all(UNDEFINED.search(one) for one in errors):
            return "parameter", errors[0]
        missing = [one for one in errors if MISSING.search(one)]
        others = [one for one in errors if not MISSING.search(one)]
        return ("incomplete", missing[0]) if missing and not others else ("refused", (others or ["no reason"])[0])
    strict, strict_found = check(glimt, path, [*options, "--strict"])
    if strict != 0:
        return "substitution", "; ".join(one["message"] for one in strict_found)
    warnings = [one["message"] for one in found]
    return ("notes", "; ".join(warnings)) if warnings else ("opens", "")


def main():
    """Prints the results, and their counts for each folder and in total."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--glimt", default="target/release/glimt")
    parser.add_argument("-D", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("folders", nargs="+", type=Path)
    arguments = parser.parse_args()
    options = [f"-D{define}" for define in arguments.D]
    totals = Counter()
    for folder in arguments.folders:
        counts = Counter()
        files = [folder] if folder.is_file() else sorted([*folder.rglob("*.xml"), *folder.rglob("*.pbrt")])
        included = included_files(files)
        for path in files:
            if path.resolve() in included or not is_whole_scene(path):
                continue
            result, reason = classify(arguments.glimt, path, options)
            counts[result] += 1
            name = path if folder.is_file() else path.relative_to(folder)
            print(f"{result:13}{name}  {reason[:300]}", flush=True)
        print(f"{folder}: {sum(counts.values())} files: {dict(counts)}", flush=True)
        totals += counts
    print(f"total: {sum(totals.values())} files: {dict(totals)}")
    complete = sum(totals.values()) - totals["incomplete"] - totals["parameter"]
    plain = totals["opens"] + totals["notes"]
    print(f"complete: {complete} files, of which {plain} ({plain / max(complete, 1):.1%}) open without a substitution")
    return 0


if __name__ == "__main__":
    sys.exit(main())
