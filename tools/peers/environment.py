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
    """Goes on as the same program inside the environment, which is made first if it is not there or not as wanted."""
    wanted = "\n".join(PACKAGES)
    finished = folder() / "packages.txt"
    if not (finished.exists() and finished.read_text() == wanted):
        make(finished, wanted)
    python = folder() / "bin" / "python"
    os.execv(python, [str(python), str(program), *sys.argv[1:]])


def make(finished, wanted):
    if sys.version_info < (3, 11):
        raise Failure(f"the peers need Python 3.11 or newer; this is {sys.version.split()[0]}")
    print(f"bench_peers: installing {', '.join(PACKAGES)} into {folder()}", file=sys.stderr)
    finished.unlink(missing_ok=True)
    python = folder() / "bin" / "python"
    for what, command in [
        ("make a Python environment (Debian: apt-get install python3-venv)", [sys.executable, "-m", "venv", "--clear", str(folder())]),
        ("install the peers from PyPI", [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PACKAGES]),
    ]:
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode != 0:
            lines = (result.stderr.strip() or result.stdout.strip() or "no message").splitlines()
            raise Failure(f"cannot {what}: {lines[-1]}")
    finished.write_text(wanted)


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
