#!/usr/bin/env python3
"""Compares photon mapping with path tracing and Mitsuba: error against passes and seconds, and the mean of the image.

    python3 benches/photons/run.py [caustic] [box] [large] [--seeds N] [--most SAMPLES | --passes N,N,…] [--side PIXELS]
        [--glimt BINARY]

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
