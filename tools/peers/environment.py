"""The Python environment with the peers in it, and LLVM for Mitsuba. Standard library only: it runs before there is any other."""
import ctypes.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

from peers.failure import Failure

PACKAGES = ["numpy==2.4.6", "matplotlib==3.11.2", "pyradiance==1.3.1", "mitsuba==3.9.1", "trimesh==5.2.0"]
LLVM_PACKAGE = "libllvm19"
LLVM_LIBRARIES = ["LLVM-19", "LLVM"]


def cache():
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "photonmill" / "peers"


def folder():
    return cache() / "environment"


def is_inside():
    return Path(sys.prefix).resolve() == folder().resolve()


def enter(program):
    """Goes on as the same program inside the environment."""
    python = python_of(folder(), PACKAGES)
    os.execv(python, [str(python), str(program), *sys.argv[1:]])


def python_of(folder, packages, own=sys.executable):
    """The Python of an environment with these packages, which is made by one's own Python if it is not there or not as wanted."""
    wanted, finished, python = "\n".join(packages), folder / "packages.txt", folder / "bin" / "python"
    if finished.exists() and finished.read_text() == wanted:
        return python
    if sys.version_info < (3, 11):
        raise Failure(f"the peers need Python 3.11 or newer; this is {sys.version.split()[0]}")
    print(f"{Path(sys.argv[0]).name}: installing {', '.join(packages)} into {folder}", file=sys.stderr)
    finished.unlink(missing_ok=True)
    said("make a Python environment (Debian: apt-get install python3-venv)", [own, "-m", "venv", "--clear", folder])
    said("install from PyPI", [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages])
    finished.write_text(wanted)
    return python


def said(what, command):
    """What a command prints."""
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if result.returncode != 0:
        lines = (result.stderr.strip() or result.stdout.strip() or "no message").splitlines()
        raise Failure(f"cannot {what}: {lines[-1]}")
    return result.stdout


def llvm():
    """Path or name of LLVM's library, which is installed if it is missing and we may."""
    if not find_llvm() and shutil.which("apt-get") and os.geteuid() == 0:
        print(f"bench_peers: installing {LLVM_PACKAGE}", file=sys.stderr)
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}}
        subprocess.run(["apt-get", "update", "-qq"], **quiet)
        subprocess.run(["apt-get", "install", "-y", "-qq", LLVM_PACKAGE], **quiet)
    found = find_llvm()
    if not found:
        remedy = f"install it (Debian: apt-get install {LLVM_PACKAGE}), or leave Mitsuba out with --only"
        raise Failure(f"Mitsuba needs LLVM's shared library; {remedy}")
    return found


def find_llvm():
    return os.environ.get("DRJIT_LIBLLVM_PATH") or next(filter(None, map(ctypes.util.find_library, LLVM_LIBRARIES)), None)
