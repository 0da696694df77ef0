"""Backends: the same answers from every one, and a worker's death costs nothing that is kept."""

import gc
import multiprocessing
import os
import signal
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest

pytest.importorskip("pydantic")
pytest.importorskip("distributed")

from sweeps import GREEDY

from jaxclay.experiments import backends, engine, load, machine, run
from jaxclay.experiments.entries.reading import read_experiment
from jaxclay.experiments.machine import identity

COUNT = 12


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    """Two tasks a batch."""
    path = tmp_path_factory.mktemp("experiment") / "small.toml"
    path.write_text(GREEDY)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "MOST", 2)
        yield path


@pytest.fixture(scope="module")
def cluster():
    """One that is there already, for all that share it."""
    with backends.local_cluster() as running:
        yield running


@pytest.fixture(scope="module")
def serial(experiment, tmp_path_factory):
    return run(experiment, tmp_path_factory.mktemp("serial"))


def assert_same(table, other):
    a, b = (one.sort_values("key", ignore_index=True) for one in (table, other))
    assert list(a.key) == list(b.key)
    assert len(a) == COUNT
    np.testing.assert_allclose(a.energy, b.energy, rtol=1e-12)


def tasks_of(experiment):
    """As workers of a thread each solve them."""
    return engine.tasks_of(read_experiment(experiment), "dask")


def killer(victims):
    """Kills the worker that the first rows come from."""

    def tell(rows, done):
        if not victims:
            victims.append(rows[0]["process"])
            assert victims[0] != os.getpid()
            os.kill(victims[0], signal.SIGKILL)

    return tell


@pytest.fixture(scope="module")
def processes(serial, experiment, tmp_path_factory):
    """A run in processes one of which is killed."""
    out, victims = tmp_path_factory.mktemp("processes"), []
    before = {name: os.environ.get(name) for name in machine.one_thread()}
    engine.run(tasks_of(experiment), out, "processes", callback=killer(victims))
    assert {name: os.environ.get(name) for name in before} == before
    return load(out), victims


def test_a_worker_that_dies_is_replaced_and_nothing_is_lost(processes, serial):
    table, (victim,) = processes
    assert_same(table, serial)
    assert set(table.process) - {victim, os.getpid()}


def test_workers_have_one_thread_each_and_the_same_compilations():
    variables = machine.one_thread()
    threads = "NPROC", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"
    assert {variables[name] for name in threads} == {"1"}
    assert variables["JAX_COMPILATION_CACHE_DIR"] == jax.config.jax_compilation_cache_dir


def test_processes_are_spawned_on_a_core_each(processes):
    table, _ = processes
    assert os.getpid() not in set(table.process)
    if hasattr(os, "sched_setaffinity"):
        assert (table.cores == 1).all()


def test_no_worker_is_left_behind(processes):
    assert [child for child in multiprocessing.active_children() if child.is_alive()] == []


def deadly(batch, wanted):
    """What kills every worker that it is given to."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_processes_that_die_again_and_again_are_said_and_what_ended_is_kept(
    serial, experiment, tmp_path, monkeypatch
):
    with monkeypatch.context() as patch:
        patch.setattr(backends, "solve_in_worker", deadly)
        with pytest.raises(RuntimeError, match="a worker process died again and again"):
            engine.run(tasks_of(experiment), tmp_path, "processes")
    assert_same(run(experiment, tmp_path), serial)


def test_a_scheduler_that_is_not_there_is_an_error(experiment, tmp_path, monkeypatch):
    monkeypatch.setattr(backends, "ANSWERS_WITHIN", 1)
    with pytest.raises(OSError, match="Timed out"):
        engine.run(
            tasks_of(experiment),
            tmp_path,
            "dask",
            "tcp://127.0.0.1:1",
        )


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "foo"])
def test_no_client_is_left_of_a_scheduler_that_is_not_there(
    experiment, tmp_path, address, monkeypatch
):
    """It would wait when it is collected, in whichever thread that happens."""
    from distributed import Client

    gc.collect()
    monkeypatch.setattr(backends, "ANSWERS_WITHIN", 1)
    gc.disable()
    try:
        with pytest.raises((OSError, ValueError)):
            engine.run(tasks_of(experiment), tmp_path, "dask", address)
        assert not [one for one in gc.get_objects() if isinstance(one, Client)]
    finally:
        gc.enable()


def test_what_is_no_address_of_a_scheduler_is_named(experiment, tmp_path):
    with pytest.raises(ValueError, match=r"--scheduler foo: missing port"):
        engine.run(tasks_of(experiment), tmp_path, "dask", "foo")


def test_an_existing_scheduler_is_used(serial, experiment, tmp_path, cluster):
    there = {worker.pid for worker in cluster.workers.values()}
    address = cluster.scheduler_address
    table = run(experiment, tmp_path, backend="dask", scheduler=address)
    assert set(table.process) <= there
    assert_same(table, serial)


def test_two_runs_on_one_scheduler_get_their_own_results(tmp_path, cluster):
    sizes = (8, 16)
    paths = [tmp_path / f"of{n}.toml" for n in sizes]
    for n, path in zip(sizes, paths, strict=True):
        path.write_text(GREEDY.replace("slices = 8", f"slices = {n}"))
    with ThreadPoolExecutor(2) as pool:
        runs = [
            pool.submit(run, path, path.with_suffix(""), backend="dask",
                        scheduler=cluster.scheduler_address)
            for path in paths
        ]  # fmt: skip
        for n, done in zip(sizes, runs, strict=True):
            assert list(done.result().slices) == [n] * COUNT


def test_workers_of_a_local_cluster_keep_compilations_in_the_same_place(cluster):
    from distributed import Client

    with Client(cluster) as client:
        found = client.run(lambda: __import__("jax").config.jax_compilation_cache_dir)
    assert set(found.values()) == {jax.config.jax_compilation_cache_dir}


def test_a_worker_of_another_version_is_refused():
    with pytest.raises(RuntimeError, match="start workers with that"):
        backends.solve_in_worker([], identity() | {"jaxclay": "0.0.1"})
