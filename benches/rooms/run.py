#!/usr/bin/env python3
"""Rooms as people make them, by glimt and by Mitsuba in turns: processor seconds x error of each, and the ratio.

    python3 benches/rooms/run.py SCENE... [--photons] [--rounds N] [--seeds N] [--samples N] [--passes N] [--side PIXELS]
        [--glimt BINARY]...

A SCENE is a scene file, of which Mitsuba gets a translation and its own reference, or a folder with scene.toml, a reference
ref.npy and mi_load.py, whose mi_dict(folder) gives the scene to Mitsuba.

In the environment of ../mitsuba, which is made where it is not there. See compare.py.
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
