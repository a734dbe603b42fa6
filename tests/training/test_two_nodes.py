"""A Ray cluster of two nodes that loses one of them: the same bytes as a run on this machine."""

import threading
import time

import pytest

from tests.support.cluster_runs import TINY, assert_same_flights, assert_same_runs
from windwrench.evaluation.benchmark import fly_all
from windwrench.training.sweep import jobs_of, run_job, run_jobs
from windwrench.training.train import train

pytestmark = pytest.mark.slow


class TwoNodes:
    """Two nodes of one core each on this machine; the second can be lost."""

    def __init__(self):
        from ray.cluster_utils import Cluster

        quiet = {"num_cpus": 1, "include_dashboard": False, "object_store_memory": 80_000_000}
        self.nodes = Cluster(initialize_head=True, head_node_args=quiet)
        self.second = self.nodes.add_node(
            num_cpus=1, object_store_memory=quiet["object_store_memory"]
        )
        self.address = self.nodes.address
        self.lost = False

    def lose_one(self):
        """Kill every process of the second node, as a machine that loses power does."""
        self.nodes.remove_node(self.second, allow_graceful=False)
        self.lost = True

    def is_busy(self):
        """Whether both nodes have work."""
        import ray

        return ray.is_initialized() and ray.available_resources().get("CPU", 0.0) == 0.0


@pytest.fixture
def two_nodes():
    ray = pytest.importorskip(
        "ray", reason="Ray is not installed: pip install 'windwrench[cluster]'"
    )
    cluster = TwoNodes()
    yield cluster
    ray.shutdown()
    cluster.nodes.shutdown()


def test_training_survives_the_loss_of_a_node(two_nodes, tmp_path):
    pytest.importorskip(
        "stable_baselines3",
        reason="stable_baselines3 is not installed: pip install 'windwrench[rl]'",
    )
    jobs = jobs_of("sac", "base", range(2), TINY, [])
    lost, over = tmp_path / "lost", threading.Event()

    def wait_for(*marks):
        while not all(mark.exists() for mark in marks) and not over.is_set():
            time.sleep(0.02)

    def held_at_its_first_checkpoint(job, folder):
        """Train until the first checkpoint, wait there until a node is lost, and go on."""
        if not lost.exists():
            train(job.config, job.scenario, job.seed, folder / job.name, stop_after=1)
            (folder / job.name / "held").touch()
            while not lost.exists():
                time.sleep(0.02)
        return run_job(job, folder)

    def kill_once_both_wait():
        wait_for(*(tmp_path / "there" / job.name / "held" for job in jobs))
        if not over.is_set():
            two_nodes.lose_one()
            lost.touch()

    killer = threading.Thread(target=kill_once_both_wait)
    killer.start()
    try:
        there = run_jobs(jobs, tmp_path / "there", two_nodes.address, held_at_its_first_checkpoint)
    finally:
        over.set()
        killer.join()
    assert two_nodes.lost
    here = [run_job(job, tmp_path / "here") for job in jobs]
    assert_same_runs(jobs, there, here, tmp_path)


def test_benchmarking_survives_the_loss_of_a_node(two_nodes):
    def kill(_):
        if not two_nodes.lost and two_nodes.is_busy():
            two_nodes.lose_one()

    there = fly_all(["admittance"], ["base"], 20, seed=0, advance=kill, cluster=two_nodes.address)
    assert two_nodes.lost
    here = fly_all(["admittance"], ["base"], 20, seed=0, jobs=1)
    assert_same_flights(there, here)
