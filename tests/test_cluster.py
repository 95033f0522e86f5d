"""Workers of Dask: the same bits as without, when workers are lost too; refusals by name."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph import cluster
from equimorph.errors import MissingError, load_package
from equimorph.study import run_study
from same_records import assert_equal

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore")
"""Dask warns of ports and of workers that are lost."""

PAGE = Path(__file__).parents[1] / "docs" / "cluster.md"
STUDY = """
[structure]
kind = "spring"

[[map]]
name = "load"
kind = "limit_load_map"
box = { x_l = [LEAST, 0.95], k = [1.0, 2.0] }
intervals = [40, 30]
load = "F"
"""
TILED = """
[structure]
kind = "spring"

[set]
box = { x_l = [0.5, 1.3], F = [-0.2, 0.2] }
intervals = [12, 12]
tiles = [2, 2]
"""
BATCHES = list(np.arange(40.0).reshape(8, 5))


def twice(x):
    return 2.0 * x


def slowly(x):
    time.sleep(0.25)
    return 2.0 * x


class Fatal:
    """Ends its process at one chunk while a file is there; else says when it was called."""

    def __init__(self, path):
        self.path = path

    def __call__(self, x):
        if x[0] == 20.0 and self.path.exists():
            os.kill(os.getpid(), signal.SIGKILL)
        return time.perf_counter_ns()


def change_versions():
    cluster.versions().update(numpy="1.0.0")


def read_versions():
    cluster.versions.cache_clear()


@contextmanager
def processes(count):
    """A client of a cluster of its own; one that is scaled may fail when it is closed."""
    with (
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=None
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def client():
    """Two processes, seen by a client; nothing is compiled or served there."""
    with processes(2) as client:
        yield client


def assert_twice(found):
    np.testing.assert_array_equal(list(found), 2.0 * np.array(BATCHES))


@pytest.mark.slow
def test_a_map_has_the_same_bits_with_any_number_of_workers():
    arch = em.Rod(load="uniform")
    grid = em.Grid(Theta=(0.3, 1.5, 50), Delta=(0.05, 0.4, 40))
    within = [arch.max_curvature <= 10.0]
    alone = em.limit_load_map(arch, grid, "q", within=within)
    for count in (1, 2, 4):
        with processes(count) as client:
            found = em.limit_load_map(arch, grid, "q", within=within, workers=cluster.dask(client))
        for name in ("value", "status", "states", "curves"):
            assert_equal(getattr(found, name), getattr(alone, name))


@pytest.mark.slow
def test_chunks_of_a_worker_that_is_lost_are_computed_by_others(client):
    workers = cluster.dask(client)
    processes = list(client.run(os.getpid).values())
    for number, after in enumerate((0.1, 0.4, 0.7)):
        threading.Timer(after, os.kill, (processes[number % 2], signal.SIGKILL)).start()
        assert_twice(workers.map(slowly, BATCHES))
        client.wait_for_workers(2, timeout=60)
        processes = list(client.run(os.getpid).values())


@pytest.mark.slow
def test_a_chunk_that_ends_all_its_workers_is_named_and_the_others_are_kept(client, tmp_path):
    """The scheduler gives up after four losses; what was found is not computed again."""
    workers, fatal, found = cluster.dask(client), Fatal(tmp_path / "bad"), []
    fatal.path.touch()
    with pytest.raises(em.LostWorkersError, match="chunk 4 were lost more often") as refused:
        found.extend(workers.map(fatal, BATCHES))
    assert len(found) == 4
    kept = int(str(refused.value).split(" finished")[0].split()[-1])
    fatal.path.unlink()
    again = list(workers.map(fatal, BATCHES))
    assert again[:4] == found
    assert 4 <= kept < len(again)
    assert list(workers.map(fatal, BATCHES)) != again


def processes_of(client) -> list[int]:
    """Processes of both workers: one that was killed is listed until another has its place."""
    found: dict = {}
    for _ in range(600):
        found = client.run(os.getpid, on_error="ignore")
        if len(found) == 2:
            break
        time.sleep(0.1)
    return sorted(found.values())


@pytest.mark.slow
def test_a_set_in_tiles_is_the_same_when_a_worker_is_killed_at_any_time(client):
    """One of two workers at each of five random times: the bits of one process."""
    arch = em.Rod(load="uniform")
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0))
    given = {"fixed": {"q": 2.5}, "within": [arch.max_curvature <= 20], "checks": 0}
    given |= {"intervals": (46, 41), "tiles": (4, 2)}
    alone = em.equilibrium_set(arch, box, **given)
    workers, rng = cluster.dask(client), np.random.default_rng(1)
    assert_equal(em.equilibrium_set(arch, box, workers=workers, **given), alone)
    began = time.perf_counter()
    em.equilibrium_set(arch, box, workers=workers, **given)
    took = time.perf_counter() - began
    for share in rng.uniform(0.05, 0.8, 5):  # a process killed twice may have no successor
        with processes(2) as fresh:
            workers = cluster.dask(fresh)
            assert_twice(workers.map(twice, BATCHES))
            process = rng.choice(processes_of(fresh))
            killer = threading.Timer(share * took, os.kill, (int(process), signal.SIGKILL))
            killer.start()
            assert_equal(em.equilibrium_set(arch, box, workers=workers, **given), alone)
            killer.join()


@pytest.mark.slow
def test_a_worker_with_other_versions_is_refused_and_errors_come_through(client):
    workers = cluster.dask(client)
    with pytest.raises(ValueError, match="text"):
        list(workers.map(float, ["text"]))
    with pytest.raises(em.InputError, match="`d` must be made of functions"):
        list(workers.map((em.Descriptor("d", "1", lambda z, p: z[:, 0]) <= 1.0).holds, BATCHES))
    client.run(change_versions)
    try:
        with pytest.raises(em.InputError, match=r"`workers` must have the same numpy as the"):
            list(workers.map(twice, BATCHES))
    finally:
        client.run(read_versions)


def test_clusters_are_told_by_their_address():
    for text in ("locally", "local:0", "http://host", "tcp://"):
        with (
            pytest.raises(em.InputError, match="`cluster` must be local, local:n or tcp://host"),
            cluster.connect(text),
        ):
            pass
    with pytest.raises(em.InputError, match="`client` must be a client of Dask"):
        cluster.dask(3)


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingError, match=r'pip install "equimorph\[cluster\]"'):
        cluster.dask(None)
    assert load_package("json", "cluster", "cluster.dask") is not None


@pytest.mark.slow
@pytest.mark.parametrize("number", range(3))
def test_examples_of_the_page_run(tmp_path, number):
    """Those with processes of this machine, each as a script of its own."""
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[number]
    (tmp_path / "script.py").write_text(code, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == re.findall(r"print.*# (.*)", code)[-1]


@pytest.mark.slow
def test_studies_run_on_a_cluster_as_without(tmp_path):
    """Two studies on two processes: tables are the same to the last digit."""
    names = ("first", "second")
    for name, least in zip(names, ("0.55", "0.6"), strict=True):
        (tmp_path / f"{name}.toml").write_text(STUDY.replace("LEAST", least), encoding="utf-8")
    for folder, words in (("without", []), ("with", ["--cluster", "local:2"])):
        files = [f"{name}.toml" for name in names]
        run = [sys.executable, "-m", "equimorph.cli", "run", *files, "--out", folder, *words]
        subprocess.run(run, cwd=tmp_path, capture_output=True, check=True)
    for name in names:
        one, other = (tmp_path / each / name / "load-map.csv" for each in ("without", "with"))
        assert one.read_bytes() == other.read_bytes()
        assert len(one.read_text(encoding="utf-8").splitlines()) > 40 * 30


@pytest.mark.slow
def test_sets_of_studies_are_lifted_in_tiles_by_a_cluster(tmp_path):
    """The set has the bits of one that is lifted here."""
    (tmp_path / "tiled.toml").write_text(TILED, encoding="utf-8")
    spring = em.Spring()
    box = em.Box(x_l=(0.5, 1.3), F=(-0.2, 0.2))
    here = em.equilibrium_set(spring, box, intervals=(12, 12), tiles=(2, 2))
    with cluster.connect("local:2") as workers:
        outcome = run_study(tmp_path / "tiled.toml", tmp_path / "out", workers=workers)
    assert_equal(outcome.equilibrium_set.points, here.points)
    np.testing.assert_array_equal(outcome.equilibrium_set.cells, here.cells)
