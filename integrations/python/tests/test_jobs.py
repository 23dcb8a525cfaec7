"""Jobs: shards in pools and on a cluster whose workers are killed give the bytes of one machine."""

import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from enfilade import jobs

# Less than the tables of the maze take, so that there are many shards.
LITTLE = "30M"


def maze(n):
    """Return a portal file of n × n rooms of 4 m, with a doorway to each neighbor."""
    portals = []
    for z in range(n):
        for x in range(n):
            room, u, v = x + n * z, 4.0 * x, 4.0 * z
            low = 1.0 + (x * 7 + z * 3) % 5 * 0.4
            door = [(low, 0), (low, 2), (low + 0.4, 2), (low + 0.4, 0)]
            if x + 1 < n:
                portals.append((room, room + 1, [(u + 4, v + along, up) for along, up in door]))
            if z + 1 < n:
                portals.append((room, room + n, [(u + along, v + 4, up) for along, up in door]))
    lines = [
        f"4 {a} {b} " + " ".join(f"({x:g} {y:g} {z:g} )" for x, y, z in door) for a, b, door in portals
    ]
    return "\n".join(["PRT1", str(n * n), str(len(portals)), *lines]) + "\n"


@pytest.fixture()
def job(command, tmp_path):
    """A job of many shards, and the file that one machine writes."""
    source = tmp_path / "maze.prt"
    source.write_text(maze(60))
    alone = tmp_path / "alone.pvs"
    command("pvs", source, "-o", alone)
    folder = tmp_path / "job"
    keys = jobs.plan(source, folder, max_memory=LITTLE, command=command.program)
    assert len(keys) > 4
    assert jobs.missing(folder) == keys
    return folder, alone


@pytest.fixture()
def slow(command, tmp_path):
    """The command, with a pause before each shard, so that a worker is killed at work."""
    program = tmp_path / "slow"
    pause = f"import os, sys, time; time.sleep(0.4); os.execv({command.program!r}, sys.argv[1:])"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{pause}" enfilade "$@"\n')
    program.chmod(0o755)
    return str(program)


def finished(job, command):
    folder, alone = job
    assert jobs.missing(folder) == []
    output = folder.parent / "together.pvs"
    jobs.finish(folder, output, command=command.program)
    return output.read_bytes() == alone.read_bytes()


def test_a_pool_of_threads_computes_all_shards_and_a_spoilt_one_again(job, command):
    with ThreadPoolExecutor(2) as pool:
        jobs.run(job[0], pool, command=command.program)
        assert finished(job, command)
        shards = sorted((job[0] / "shards").glob("*.block"))
        shards[0].write_bytes(shards[0].read_bytes()[:-5])
        shards[1].unlink()
        with pytest.raises(jobs.JobError, match="missing"):
            jobs.finish(job[0], job[0].parent / "early.pvs", command=command.program)
        command("job", "run", job[0])
        assert finished(job, command)


def test_dask_computes_the_shards_of_killed_workers_elsewhere(job, slow, command):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster, distributed.Client(cluster) as client:
        def kill():
            time.sleep(0.5)
            assert jobs.missing(job[0])
            os.kill(client.run(os.getpid).popitem()[1], signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        jobs.run(job[0], client, command=slow)
        killer.join()
    assert finished(job, command)


def test_errors_say_what_to_do(tmp_path):
    with pytest.raises(jobs.JobError, match="jobs.plan"):
        jobs.missing(tmp_path)
    with pytest.raises(jobs.JobError, match="install enfilade's command"):
        jobs.plan("world.glb", tmp_path, command="no-such-program")
