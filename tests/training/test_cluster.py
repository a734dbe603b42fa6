"""Tasks and flights on a Ray cluster: the same numbers as here, and a lost worker costs
nothing.
"""

import os
import signal
import time

import pytest
from numpy.testing import assert_array_equal

from tests.runtime.test_workers import work
from tests.support.outcomes import refused
from windwrench.evaluation.benchmark import Request, fly_all
from windwrench.runtime.workers import each, every


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip("ray", reason="pip install 'windwrench[cluster]'")
    # "local": a cluster of its own, whatever else runs on this machine
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield "local"  # the one that is connected already
    ray.shutdown()


def refuse(task):
    raise ValueError(f"not a number: {task}\nand more")


def test_a_task_whose_worker_is_killed_is_done_again(cluster, tmp_path):
    def die_once(mark):
        if not os.path.exists(mark):
            open(mark, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid()

    ((_, done_by),) = every(die_once, [str(tmp_path / "killed")], cluster=cluster)
    assert (tmp_path / "killed").exists()
    assert done_by != os.getpid()


def test_a_task_that_fails_is_named(cluster):
    with refused(r"--cluster local: a task failed: not a number: \[\]$"):
        list(every(refuse, [[]], cluster=cluster))


@pytest.mark.slow
def test_flights_on_a_cluster_are_the_local_ones(cluster):
    request = Request(("admittance",), ("base",), 4, 0)
    there = fly_all(request, cluster=cluster)
    here = fly_all(request, jobs=1)
    assert list(there) == list(here)
    for key, flown in here.items():
        for a, b in zip(flown, there[key], strict=True):
            assert_array_equal(a.y, b.y)
            assert (a.rmse, a.seed, a.lost) == (b.rmse, b.seed, b.lost)


@pytest.mark.slow
def test_rllib_knows_the_environment_by_its_name(cluster):
    ppo = pytest.importorskip(
        "ray.rllib.algorithms.ppo",
        reason="RLlib lacks what it needs: pip install dm-tree ormsgpack",
    )
    config = (
        ppo.PPOConfig()
        .environment("windwrench:windwrench/FanTracking-v1", env_config={"scenario": "base"})
        .env_runners(num_env_runners=0, rollout_fragment_length=50)
        .training(train_batch_size_per_learner=50, minibatch_size=25, num_epochs=1)
    )
    algorithm = config.build_algo()
    assert algorithm.train()["env_runners"]["num_env_steps_sampled"] == 50
    algorithm.stop()


@pytest.mark.slow  # the workflow's job runs this file whole
def test_a_task_that_dies_or_takes_too_long_costs_itself_alone(cluster):
    done = dict(each(work, [0, "exits", 1], cluster=cluster))
    assert (done.pop("exits").kind, done.keys()) == ("died", {0, 1})
    for _ in range(2):  # the first time a worker starts again, the second time none
        begun = time.monotonic()
        assert dict(each(work, [0, 1], cluster=cluster)).keys() == {0, 1}
    limit = 3.0 + 3.0 * (time.monotonic() - begun)  # however busy this machine is
    done = dict(each(work, [0, "sleeps", 1], limit, cluster=cluster))
    assert (done.pop("sleeps").kind, done.keys()) == ("time", {0, 1})


def test_a_cluster_that_is_not_there_is_named():
    ray = pytest.importorskip("ray", reason="pip install 'windwrench[cluster]'")
    if ray.is_initialized():  # last in this file: those before have one cluster
        ray.shutdown()
    with refused(r"127\.0\.0\.1:1: no Ray cluster there"):
        next(every(len, [[1]], cluster="127.0.0.1:1"))
