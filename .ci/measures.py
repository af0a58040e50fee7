#!/usr/bin/env python3
"""Prints measures of the source tree's size: the path tracer's main loop, the functions that a BSDF must define, and the code lines of each crate.

    python3 .ci/measures.py

Code lines exclude blank lines, comments and tests (`#[cfg(test)]` modules, and files named `*tests.rs` or in `tests` folders).
"""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INTEGRATORS = ROOT / "crates" / "trace" / "src" / "integrators"
TEST_MODULE = re.compile(r"^#\[cfg\(test\)\]\n(?:pub )?mod \w+ \{", re.MULTILINE)
TEST_FILE = re.compile(r"(^|/)(\w*tests|test_\w+)(/|\.rs$)")
TEST_MODULE_FILE = re.compile(r"^#\[cfg\(test\)\]\n(?:pub(?:\(\w+\))? )?mod (\w+);", re.MULTILINE)


def code_lines(text):
    """Number of code lines before the first test module with a body."""
    code = 0
    for line in TEST_MODULE.split(text)[0].splitlines():
        stripped = line.strip()
        code += bool(stripped) and not stripped.startswith("//")
    return code


def test_module_files(files):
    """Files and folders of modules that are only compiled for tests."""
    found = set()
    for file in files:
        folder = file.parent if file.stem in ("lib", "main", "mod") else file.with_suffix("")
        for name in TEST_MODULE_FILE.findall(file.read_text()):
            found |= {folder / f"{name}.rs", folder / name}
    return found


def required_functions(path, trait):
    """Names of a trait's functions without a default body."""
    body = re.search(rf"^pub trait {trait}\b.*?^}}", path.read_text(), re.MULTILINE | re.DOTALL)[0]
    return re.findall(r"^    fn (\w+)[^{;]*;", body, re.MULTILINE)


def main():
    loop = INTEGRATORS / "path.rs"
    print(f"{len(loop.read_text().splitlines()):7} lines of the main loop, in {loop.relative_to(ROOT)}")
    parts = sorted(((len(part.read_text().splitlines()), part) for part in (INTEGRATORS / "path").glob("*.rs")), reverse=True)
    print(f"{parts[0][0]:7} lines of its largest part, in {parts[0][1].relative_to(ROOT)}")
    functions = required_functions(ROOT / "crates" / "kernel" / "src" / "materials" / "bxdf.rs", "Bxdf")
    print(f"{len(functions):7} functions that a BSDF must define: {', '.join(functions)}")
    total = 0
    for crate in sorted((ROOT / "crates").iterdir()):
        files = [file for file in crate.glob("src/**/*.rs") if not TEST_FILE.search(str(file.relative_to(crate)))]
        tests = test_module_files(files)
        lines = sum(code_lines(file.read_text()) for file in files if not tests & {file, *file.parents})
        total += lines
        print(f"{lines:7} code lines in {crate.name}")
    print(f"{total:7} code lines in all crates")


main()
