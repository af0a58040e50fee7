#!/usr/bin/env python3
"""Compares glimt with Mitsuba on realistic scenes, with interleaved renders: processor seconds x error, and the ratio.

    python3 benches/rooms/run.py SCENE... [--photons] [--rounds N] [--seeds N] [--samples N] [--passes N] [--side PIXELS]
        [--glimt BINARY]...

A SCENE is a scene file, which is translated for Mitsuba and gets its own reference, or a folder with scene.toml, a reference ref.npy, and
mi_load.py, whose mi_dict(folder) returns the scene for Mitsuba.

Runs in the environment of ../mitsuba, which is created if it does not exist. See compare.py.
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
    command = [str(run.python()), str(HERE / "compare.py"), *sys.argv[1:]]
    os.execve(command[0], command, environment)
