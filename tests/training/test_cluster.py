"""Training runs and flights on a Ray cluster: the same numbers as here, and a lost worker costs
nothing.
"""

import os
import signal
import threading
import time

import numpy as np
import pytest

from windwrench.dynamics import InputError
from windwrench.evaluation.benchmark import fly_all
from windwrench.runtime.workers import each, every
from windwrench.training.rllib import register_with_rllib
from windwrench.training.sweep import jobs_of, run_job, run_jobs

# settings of a training run of seconds, with checkpoints in its middle
TINY = [
    "steps=240",
    "environments=2",
    "net=[8]",
    "learner.learning_starts=40",
    "learner.batch_size=16",
    "checkpoint=60",
    "validation.every=120",
    "validation.episodes=1",
]


def assert_same_runs(jobs, there, here, folder):
    """Hold runs done in ``folder``/there to those in ``folder``/here, byte for byte."""
    assert [r["run"] for r in there] == [r["run"] for r in here]
    assert [r["validation_rmse_m"] for r in there] == [r["validation_rmse_m"] for r in here]
    for job in jobs:
        for name in ("best.npz", "last.npz"):
            assert (folder / "there" / job.name / name).read_bytes() == (
                folder / "here" / job.name / name
            ).read_bytes()


def assert_same_flights(there, here):
    """Hold the episodes of one benchmark to those of another, number for number."""
    assert list(there) == list(here)
    for key, flown in here.items():
        for a, b in zip(flown, there[key], strict=True):
            np.testing.assert_array_equal(a.y, b.y)
            assert (a.rmse, a.seed, a.lost) == (b.rmse, b.seed, b.lost)


def test_a_sweep_is_every_value_with_every_seed():
    jobs = jobs_of("sac", "base", range(2), TINY, ["learner.gamma=0.9|0.95", "net=[8]|[16]"])
    assert [job.name for job in jobs][:3] == [
        "gamma-0.9-net-8-seed-0",
        "gamma-0.9-net-8-seed-1",
        "gamma-0.9-net-16-seed-0",
    ]
    assert [(job.config["learner"]["gamma"], job.config["net"], job.seed) for job in jobs] == [
        (0.9, [8], 0),
        (0.9, [8], 1),
        (0.9, [16], 0),
        (0.9, [16], 1),
        (0.95, [8], 0),
        (0.95, [8], 1),
        (0.95, [16], 0),
        (0.95, [16], 1),
    ]


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip(
        "ray", reason="Ray is not installed: pip install 'windwrench[cluster]'"
    )
    # "local": a cluster of its own, whatever else runs on this machine
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield "local"  # the one that is connected already
    ray.shutdown()


@pytest.mark.slow  # a task that is done again, and a run that goes on where it stopped, are quick
def test_runs_on_a_cluster_are_the_local_ones_though_a_worker_is_killed(cluster, tmp_path):
    pytest.importorskip(
        "stable_baselines3",
        reason="stable_baselines3 is not installed: pip install 'windwrench[rl]'",
    )
    jobs = jobs_of("sac", "base", range(2), TINY, [])
    process, killed = tmp_path / "process", []

    def run_noted(job, folder):
        if job.name == jobs[0].name:
            process.write_text(str(os.getpid()))
        return run_job(job, folder)

    def kill_one():
        deadline = time.monotonic() + 300
        while not killed and time.monotonic() < deadline:
            if (tmp_path / "there" / jobs[0].name / "checkpoint.pt").exists():
                killed.append(int(process.read_text()))
                os.kill(killed[0], signal.SIGKILL)
            time.sleep(0.02)

    killer = threading.Thread(target=kill_one)
    killer.start()
    there = run_jobs(jobs, tmp_path / "there", cluster, run_noted)
    killer.join()
    assert killed
    assert int(process.read_text()) != killed[0]  # another process went on
    here = [run_job(job, tmp_path / "here") for job in jobs]
    assert_same_runs(jobs, there, here, tmp_path)


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
    with pytest.raises(InputError, match=r"--cluster local: a task failed: not a number: \[\]$"):
        list(every(refuse, [[]], cluster=cluster))


@pytest.mark.slow
def test_flights_on_a_cluster_are_the_local_ones(cluster):
    there = fly_all(["admittance"], ["base"], 4, seed=0, cluster=cluster)
    here = fly_all(["admittance"], ["base"], 4, seed=0, jobs=1)
    assert_same_flights(there, here)


def test_rllib_knows_the_environment_after_one_line(cluster):
    register_with_rllib()
    ppo = pytest.importorskip(
        "ray.rllib.algorithms.ppo",
        reason="RLlib lacks what it needs: pip install dm-tree ormsgpack",
    )
    config = (
        ppo.PPOConfig()
        .environment("windwrench", env_config={"scenario": "base"})
        .env_runners(num_env_runners=0, rollout_fragment_length=50)
        .training(train_batch_size_per_learner=50, minibatch_size=25, num_epochs=1)
    )
    algorithm = config.build_algo()
    result = algorithm.train()
    assert result["env_runners"]["num_env_steps_sampled"] == 50
    algorithm.stop()


def fleet_work(task):
    """Answer, or end as the task says."""
    if task == "exits":
        os._exit(3)
    if task == "sleeps":
        time.sleep(600.0)
    return task


def test_a_task_that_dies_or_takes_too_long_costs_itself_alone(cluster):
    done = dict(each(fleet_work, [0, "exits", 1], cluster=cluster))
    assert (done.pop("exits").kind, done) == ("died", {0: 0, 1: 1})
    for _ in range(2):  # the first time a worker starts again, the second time none
        begun = time.monotonic()
        assert dict(each(fleet_work, [0, 1], cluster=cluster)) == {0: 0, 1: 1}
    limit = 3.0 + 3.0 * (time.monotonic() - begun)  # however busy this machine is
    done = dict(each(fleet_work, [0, "sleeps", 1], limit, cluster=cluster))
    assert (done.pop("sleeps").kind, done) == ("time", {0: 0, 1: 1})


def test_a_cluster_that_is_not_there_is_named():
    ray = pytest.importorskip(
        "ray", reason="Ray is not installed: pip install 'windwrench[cluster]'"
    )
    if ray.is_initialized():  # last in this file: those before have one cluster
        ray.shutdown()
    with pytest.raises(InputError, match=r"127\.0\.0\.1:1: no Ray cluster there"):
        next(every(len, [[1]], cluster="127.0.0.1:1"))
