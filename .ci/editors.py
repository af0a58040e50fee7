#!/usr/bin/env python3
"""Runs common validators on the schema and the scenes: Taplo with draft 4, check-jsonschema with both drafts.

Both must accept every bundled scene, and must report mistakes in tests/broken on the lines on which `glimt check --json` reports them.
Needs `taplo` and `check-jsonschema` on the path (both are on PyPI) and a built glimt:

    python3 .ci/editors.py target/release/glimt
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Minimum number of files in which Taplo must find a mistake on the right line.
MIN_FILES = 30


def run(*command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True)


def mistakes(glimt, path):
    """Lines on which glimt reports errors."""
    report = json.loads(run(glimt, "check", "--json", path).stdout)
    return {one["line"] for one in report["diagnostics"] if one["severity"] == "error" and one["line"]}


def taplo_errors(schema, path):
    """Lines on which Taplo reports errors."""
    said = run("taplo", "lint", "--colors", "never", "--schema", schema.as_uri(), path)
    lines = set()
    for line, _ in re.findall(r"[┌╭][^\n]*?\.toml:(\d+):(\d+)", said.stderr + said.stdout):
        lines.add(int(line))
    return lines, said


def main():
    glimt = pathlib.Path(sys.argv[1]).resolve()
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        drafts = {}
        for draft in ["4", "2020-12"]:
            drafts[draft] = pathlib.Path(folder) / f"schema-{draft}.json"
            drafts[draft].write_text(run(glimt, "schema", "--draft", draft).stdout)
        meta = run("check-jsonschema", "--check-metaschema", *drafts.values())
        if meta.returncode:
            faults.append(f"invalid schema: {meta.stdout[:500]}")
        scenes = sorted((ROOT / "scenes").glob("*.toml"))
        for draft, schema in drafts.items():
            said = run("check-jsonschema", "--schemafile", schema, *scenes)
            if said.returncode:
                faults.append(f"check-jsonschema, draft {draft}: {said.stdout[:500]}")
        # Taplo finds the schema through the directive on the first line of each scene.
        said = run("taplo", "lint", "--colors", "never", *scenes)
        if said.returncode:
            faults.append(f"taplo: {said.stderr[:500]}")

        found, partly, left = [], [], []
        for path in sorted((ROOT / "tests" / "broken").glob("*.toml")):
            wrong = mistakes(glimt, path)
            if not wrong:
                continue
            lines, _ = taplo_errors(drafts["4"], path)
            kind = found if wrong <= lines else partly if wrong & lines else left
            kind.append((path.stem, sorted(wrong), sorted(lines)))
        for name, all_of in [("all mistakes on their lines", found), ("some of them", partly), ("none", left)]:
            print(f"Taplo finds {name}: {len(all_of)} files")
            for stem, wrong, lines in all_of:
                print(f"    {stem:22} glimt {wrong}, Taplo {lines}")
        rejected = [
            path.stem
            for path in sorted((ROOT / "tests" / "broken").glob("*.toml"))
            if run("check-jsonschema", "--schemafile", drafts["2020-12"], path).returncode
        ]
        print(f"check-jsonschema rejects {len(rejected)} files")
        if len(found) + len(partly) < MIN_FILES:
            faults.append(f"Taplo finds mistakes in only {len(found) + len(partly)} files")
    print(f"{len(scenes)} scenes are valid" if not faults else "\n".join(faults))
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
