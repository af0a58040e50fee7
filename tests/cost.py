#!/usr/bin/env python3
"""Prints the processor time of all tests and lists the most expensive ones.

    python3 tests/cost.py [PROFILE [COUNT]]      (default: dev, 10)

Tests run one after the other, each in its own process. Processor times include the programs that a test starts.
"""

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def executables(profile):
    """Returns the name, executable and folder of each package's tests."""
    command = ["cargo", "test", "--profile", profile, "--workspace", "--no-run", "--message-format=json"]
    built = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True)
    messages = [json.loads(line) for line in built.stdout.splitlines() if line.startswith(b"{")]
    tests = [m for m in messages if m.get("executable") and m["profile"]["test"]]
    return [(m["target"]["name"], m["executable"], Path(m["manifest_path"]).parent) for m in tests]


def test_names(program, folder):
    listed = subprocess.run([program, "--list"], cwd=folder, capture_output=True, text=True, check=True)
    ignored = subprocess.run([program, "--list", "--ignored"], cwd=folder, capture_output=True, text=True, check=True)
    tests = lambda run: [line[:-len(": test")] for line in run.stdout.splitlines() if line.endswith(": test")]
    skipped = set(tests(ignored))
    return [name for name in tests(listed) if name not in skipped]


def processor_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main():
    profile, count = (sys.argv[1:] + ["dev", "10"][len(sys.argv) - 1:])[:2]
    costs, failed = [], []
    for name, program, folder in executables(profile):
        for test in test_names(program, folder):
            begun, before = time.monotonic(), processor_seconds()
            run = subprocess.run([program, "--exact", test], cwd=folder, env=dict(os.environ), capture_output=True)
            costs.append((processor_seconds() - before, time.monotonic() - begun, f"{name} {test}"))
            if run.returncode != 0:
                failed.append(costs[-1][2])
    costs.sort(reverse=True)
    print(f"{len(costs)} tests: {sum(cost for cost, *_ in costs):.1f} s of processor time, "
          f"{sum(waited for _, waited, _ in costs):.1f} s of wall-clock time")
    for cost, waited, name in costs[:int(count)]:
        print(f"{cost:8.2f} s  ({waited:6.2f} s)  {name}")
    if failed:
        sys.exit("failed: " + ", ".join(failed))


main()
