"""Bakes and visibility on many machines: the shards of a job, handed to Dask, to Ray, or to a pool of the standard library.

The command ``enfilade`` does the work: it must be on every machine, and the folder of the job where all of them see it. A
shard computed twice has the same bytes, so nothing is lost or spoilt if a machine dies or is slow:

>>> from dask.distributed import Client
>>> from enfilade import jobs
>>> jobs.plan("town.glb", "job")
>>> jobs.run("job", Client("scheduler:8786"))
>>> jobs.finish("job", "town.pvs", into="town.glb")
"""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, List, Optional, Sequence, Union

from ._native import EnfiladeError

File = Union[str, "os.PathLike[str]"]

__all__ = ["JobError", "finish", "missing", "plan", "run"]


class JobError(EnfiladeError):
    """A step of a job failed; the message is the command's."""


def plan(
    source: File,
    folder: File,
    *,
    mode: Optional[str] = None,
    far: Optional[float] = None,
    max_memory: Union[None, int, str] = None,
    options: Sequence[str] = (),
    command: str = "enfilade",
) -> List[str]:
    """Divide the work for a file into shards; return their keys.

    A scene is baked, a shard for each building apart from others; ``options`` are those of ``enfilade bake``. Of a world, or a
    Quake portal file, it is found what is visible from where: ``mode`` is "exact" (the default) or "fast", and ``far`` a distance
    in meters beyond which everything is treated as hidden. ``max_memory`` is the most memory of a process that computes a
    shard, in bytes or as the command takes it ("8G"). Less makes more shards of visibility; a graph of up to 10,000 portals
    is a single one unless this is less than its tables. The same plan again leaves the folder as it is.
    """
    given: List[str] = []
    for name, value in [("--mode", mode), ("--far", far), ("--max-memory", max_memory)]:
        if value is not None:
            given += [name, str(value)]
    if options:
        given += ["--", *options]
    _call(command, "plan", os.fspath(source), "-o", os.fspath(folder), *given)
    return _shards(folder)


def missing(folder: File) -> List[str]:
    """Return the keys of the shards that are not there yet."""
    done = {path.stem for path in Path(folder, "shards").glob("*.block")}
    return [key for key in _shards(folder) if key not in done]


def run(folder: File, pool: Any, *, threads: int = 1, retries: int = 3, command: str = "enfilade") -> None:
    """Compute the missing shards, and wait until all are there; run it again to resume.

    ``pool`` is a ``dask.distributed.Client``, the module ``ray`` after ``ray.init()``, or an executor of
    ``concurrent.futures``. Dask and Ray compute the shards of workers that die elsewhere, ``retries`` times at most. ``threads`` is
    the number of threads for a shard; Ray reserves as many processors.
    """
    folder = os.path.abspath(os.fspath(folder))
    keys = missing(folder)
    arguments = [(command, folder, key, threads) for key in keys]
    if hasattr(pool, "remote") and hasattr(pool, "get"):
        shard = pool.remote(_shard).options(num_cpus=threads, max_retries=retries)
        pool.get([shard.remote(*a) for a in arguments])
    elif hasattr(pool, "scheduler_info"):
        futures = [pool.submit(_shard, *a, pure=False, retries=retries) for a in arguments]
        pool.gather(futures)
    else:
        for future in [pool.submit(_shard, *a) for a in arguments]:
            future.result()


def finish(folder: File, output: File, *, into: Optional[File] = None, command: str = "enfilade") -> None:
    """Put all shards together: write what ``enfilade bake`` or ``enfilade pvs`` writes on one machine.

    ``into`` is a file for the world with visibility in it.
    """
    options = [] if into is None else ["--into", os.fspath(into)]
    _call(command, "finish", os.fspath(folder), "-o", os.fspath(output), *options)


def _shards(folder: File) -> List[str]:
    manifest = Path(folder, "manifest.json")
    try:
        shards: List[str] = json.loads(manifest.read_text(encoding="utf-8"))["shards"]
        return shards
    except FileNotFoundError:
        raise JobError(f"{manifest} is not there: make the job first, with jobs.plan") from None


def _shard(command: str, folder: str, key: str, threads: int) -> str:
    _call(command, "run", folder, key, "--threads", str(threads))
    return key


def _call(command: str, step: str, *arguments: str) -> None:
    program = shutil.which(command)
    if program is None:
        raise JobError(f"no program {command!r}: install enfilade's command on this machine, or pass command=PATH")
    done = subprocess.run([program, "job", step, *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise JobError(done.stderr.strip() or f"enfilade job {step} ended with code {done.returncode}")
