"""One run of a program at one budget: what it is asked, what it gives back, and the clock around its processes."""
import os
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from peers.failure import Failure


@dataclass
class Machine:
    """What every program gets: as many threads as cores, and a folder for its files."""

    threads: int
    folder: Path


@dataclass
class Run:
    irradiance: np.ndarray  # (5, 64, 64), W/m2
    whole_s: float
    computing_s: float
    sample_count: int
    # Seconds of the parts that the program distinguishes.
    parts_s: dict = field(default_factory=dict)


def clocked(command, nudge=None, **streams):
    """Runs a command; its standard output and the seconds from start to end. It gets the signal `nudge` 50 times a second."""
    command = [str(word) for word in command]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams}
    start = time.perf_counter()
    try:
        process = subprocess.Popen(command, **streams)
    except OSError as error:
        raise Failure(f"cannot start {command[0]}: {error.strerror}") from None
    with process:
        try:
            while True:
                try:
                    output, errors = process.communicate(timeout=0.02 if nudge else None)
                    break
                except subprocess.TimeoutExpired:
                    process.send_signal(nudge)
        except BaseException:
            process.terminate()
            raise
    seconds = time.perf_counter() - start
    if process.returncode != 0:
        lines = errors.decode(errors="replace").strip().splitlines() or ["no message"]
        raise Failure(f"{Path(command[0]).name} ended with {process.returncode}: {lines[-1]} (command: {' '.join(command)})")
    return output, seconds


def confine(threads):
    """Leaves this process, and all that it starts, as many cores as threads."""
    allowed = sorted(os.sched_getaffinity(0))
    if threads > len(allowed):
        raise Failure(f"--threads {threads}: this machine has {len(allowed)} cores for us; ask for as many at most")
    os.sched_setaffinity(0, allowed[:threads])
