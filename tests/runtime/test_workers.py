"""Workers that stay warm, and interrupts that are not lost."""

import multiprocessing
import os
import signal
import time
import weakref
from contextlib import suppress
from pathlib import Path

import pytest

from tests.support.outcomes import refused
from tests.support.programs import until
from windwrench.runtime.interrupts import noted
from windwrench.runtime.workers import Lost, each, every


def work(task):
    """Answer with the process, or end as the task says."""
    if task == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if task == "exits":
        os._exit(3)
    if task == "sleeps":
        time.sleep(600.0)
    if task == "raises":
        raise ValueError(task)
    if isinstance(task, Path) and not task.exists():  # dies the first time
        task.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid(), os.environ.get("OPENBLAS_NUM_THREADS")


def lives(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def has_ended(process):
    multiprocessing.active_children()  # takes note of those that are gone
    return not lives(process)


def outcomes(tasks, count=1, limit=60.0):
    return list(each(work, tasks, limit, count))


def test_a_worker_stays_warm_and_alone(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    done = outcomes(range(4))
    assert [task for task, _ in done] == [0, 1, 2, 3]
    assert {threads for _, (_, threads) in done} == {"1"}
    (process,) = {process for _, (process, _) in done}
    assert process != os.getpid()
    until(lambda: has_ended(process))  # with the work
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_a_death_costs_its_own_task_alone(tmp_path):
    tasks = [0, "dies", 1, tmp_path / "mark", "exits", 2]
    done = dict(outcomes(tasks, 2))
    assert set(done) == set(tasks)
    assert done["dies"].kind == "died"
    assert "SIGKILL" in done["dies"].words
    assert "code 3" in done["exits"].words
    assert not any(isinstance(done[task], Lost) for task in (0, 1, 2))
    assert done[tmp_path / "mark"][0] != os.getpid()  # its second attempt


def test_a_task_that_takes_too_long_is_ended():
    done = dict(outcomes([0, "sleeps", 1], limit=4.0))
    assert done["sleeps"] == Lost("time", "it took more than 4 s")
    assert done[1][0] != done[0][0]  # another process took over


def test_tasks_are_taken_when_a_worker_is_free():
    taken = []

    def tasks():
        for i in range(6):
            taken.append(i)
            yield i

    running = each(work, tasks(), 60.0, 1)
    next(running)
    assert taken == [0]
    running.close()


def test_a_worker_that_dies_while_it_waits_is_replaced():
    """As where another program took the memory."""
    running = each(work, [0, 1], 60.0, 1)
    _, (process, _) = next(running)
    os.kill(process, signal.SIGKILL)
    until(lambda: has_ended(process))
    time.sleep(0.5)  # for the pool to see it
    (task, (other, _)) = next(running)
    assert (task, other == process) == (1, False)
    assert list(running) == []


def test_what_the_work_raises_is_raised():
    with pytest.raises(ValueError, match="raises"):
        outcomes([0, "raises", 1])


def test_an_interrupt_ends_the_processes_at_once():
    processes = set()

    def interrupt():
        processes.update(child.pid for child in multiprocessing.active_children())
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(every(work, ["sleeps"], 1, idle=interrupt))
    assert processes
    assert not any(map(lives, processes))


def test_a_task_that_dies_each_time_ends_all():
    with refused(r"this machine: a task failed: .* SIGKILL"):
        list(every(work, [0, "dies"], 1))


class Thing:
    """Something to be collected."""


def lose(things):
    """Have an interrupt come within the callback of something that is collected."""
    reference = weakref.ref(things[0], lambda _: signal.raise_signal(signal.SIGINT))
    things.clear()
    time.sleep(5.0)
    assert reference() is None


def swallow(_):
    """Have an interrupt come within code that goes on whatever happens, as imports in C do."""
    with suppress(BaseException):
        signal.raise_signal(signal.SIGINT)
    time.sleep(5.0)


@pytest.mark.parametrize("loses", [lose, swallow])
def test_one_that_is_lost_comes_again_until_it_has_an_answer(loses):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with noted() as came:
            with pytest.raises(KeyboardInterrupt):
                loses([Thing()])
            assert came()
            time.sleep(0.1)
    finally:
        signal.signal(signal.SIGINT, before)
