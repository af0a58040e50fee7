#!/usr/bin/env python3
"""Compares glimt with Mitsuba on metals under a sky and rough glass in front of a light: processor seconds x error, and the ratio.

    python3 benches/materials/run.py [SCENE...] [--rounds N] [--seeds N] [--samples N] [--glimt BINARY]...

Measures as ../rooms/run.py does, with metals.toml and glass.toml from this folder, or with the given scenes.
"""

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "mitsuba"))
import run  # noqa: E402

if __name__ == "__main__":
    run.HOME.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": run.llvm(), "GLIMT_MITSUBA_HOME": str(run.HOME)}
    given = sys.argv[1:]
    named = given[:1] and not given[0].startswith("-")
    scenes = [] if named else [str(HERE / "metals.toml"), str(HERE / "glass.toml")]
    command = [str(run.python()), str(HERE.parent / "rooms" / "compare.py"), *scenes, *given]
    os.execve(command[0], command, environment)
