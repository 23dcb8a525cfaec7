"""Jobs: shards in pools and on a cluster whose workers are killed give the bytes of one machine."""

import contextlib
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
    output = folder.parent / f"together{alone.suffix}"
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


@pytest.fixture()
def bakes(command, tmp_path):
    """A job that bakes houses apart from each other, and the world that one machine writes."""
    source = tmp_path / "houses.obj"
    lines = []
    for n in range(5):
        x, z = 150.0 * n, 150.0 * (n * n % 5)
        corners = [(x + a, b, z + c) for a in (0, 5 + n) for b in (0, 3) for c in (0, 4)]
        lines += [f"v {a} {b} {c}" for a, b, c in corners]
        # Seen from inside.
        sides = [(3, 4, 2, 1), (6, 8, 7, 5), (2, 6, 5, 1), (7, 8, 4, 3), (5, 7, 3, 1), (4, 8, 6, 2)]
        lines += ["f " + " ".join(str(8 * n + at) for at in side) for side in sides]
    source.write_text("\n".join(lines))
    alone = tmp_path / "alone.glb"
    command("bake", source, "-o", alone, "--min-opening", "0.4")
    folder = tmp_path / "bakes"
    keys = jobs.plan(source, folder, options=["--min-opening", "0.4"], command=command.program)
    assert len(keys) == 5 and jobs.missing(folder) == keys
    return folder, alone


def test_dask_bakes_while_one_worker_is_frozen_and_one_killed(bakes, slow, command):
    distributed = pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    with dask.config.set({"distributed.scheduler.worker-ttl": "3s"}), distributed.LocalCluster(
        n_workers=3, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster, distributed.Client(cluster) as client:
        frozen, killed, _ = client.run(os.getpid).values()

        def harm():
            time.sleep(0.5)
            assert jobs.missing(bakes[0])
            os.kill(frozen, signal.SIGSTOP)
            os.kill(killed, signal.SIGKILL)

        harmer = threading.Thread(target=harm)
        harmer.start()
        jobs.run(bakes[0], client, command=slow)
        harmer.join()
        # Its keeper may have replaced it.
        with contextlib.suppress(ProcessLookupError):
            os.kill(frozen, signal.SIGCONT)
    assert finished(bakes, command)


def test_two_pools_on_one_folder_write_the_same_bytes(bakes, command):
    with ThreadPoolExecutor(2) as one, ThreadPoolExecutor(2) as other:
        pools = [
            threading.Thread(target=jobs.run, args=(bakes[0], pool), kwargs={"command": command.program})
            for pool in (one, other)
        ]
        for pool in pools:
            pool.start()
        for pool in pools:
            pool.join()
    assert finished(bakes, command)


def test_errors_say_what_to_do(tmp_path):
    with pytest.raises(jobs.JobError, match="jobs.plan"):
        jobs.missing(tmp_path)
    with pytest.raises(jobs.JobError, match="install enfilade's command"):
        jobs.plan("world.glb", tmp_path, command="no-such-program")
