#!/usr/bin/env python3
"""Compares glimt with Mitsuba 3 (llvm, multijitter): seconds x relMSE of the same scenes, with interleaved renders.

    python3 benches/mitsuba/run.py [NAME...] [--rounds N] [--spread] [--glimt BINARY...]

Errors are relative to references, which take minutes to render and are cached; `--spread` uses only the images of the rounds.

Creates its own environment in target/mitsuba: Mitsuba from pip, and Debian's LLVM from `apt-get download` unless DRJIT_LIBLLVM_PATH is
set. glimt is target/release/glimt, which must exist; with several binaries, all are measured.
"""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
HOME = HERE.parent.parent / "target" / "mitsuba"
LLVM_PACKAGE = "libllvm19"


def python():
    """The Python interpreter of the environment with Mitsuba."""
    path = HOME / "env" / "bin" / "python"
    if not path.exists():
        subprocess.run([sys.executable, "-m", "venv", HOME / "env"], check=True)
    if subprocess.run([path, "-c", "import mitsuba"], capture_output=True).returncode != 0:
        subprocess.run([path, "-m", "pip", "install", "--quiet", "mitsuba", "numpy"], check=True)
    return path


def llvm():
    """The LLVM library that Mitsuba compiles with."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        return named
    folder = HOME / "llvm"
    if not any(folder.rglob("libLLVM*.so*")):
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(["apt-get", "download", LLVM_PACKAGE], cwd=folder, check=True, stderr=subprocess.DEVNULL)
        package = next(folder.glob("*.deb"))
        subprocess.run(["dpkg-deb", "-x", package, folder], check=True)
    return str(next(path for path in folder.rglob("libLLVM.so*") if not path.is_symlink()))


if __name__ == "__main__":
    HOME.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": llvm(), "GLIMT_MITSUBA_HOME": str(HOME)}
    command = [str(python()), str(HERE / "compare.py"), *sys.argv[1:]]
    os.execve(command[0], command, environment)
