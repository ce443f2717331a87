"""Where blocks are worked on: in this process, in processes of this machine, or on a Dask cluster. The bits are the same."""

from __future__ import annotations

import os
import platform
import signal
import threading
import time
from collections.abc import Collection, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from truenorth.campaign.plan import Plan, read_plan
from truenorth.campaign.store import Block, other_versions, versions
from truenorth.core.errors import UsageError
from truenorth.core.worker import begin

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

Done = Generator[tuple[Block, Any], None, None]  # to be closed: the workers end with it
AHEAD = 2  # blocks under way for each worker: memory stays bounded, and no worker waits
PATIENCE = 2.0  # s: for processes to end in
ATTEMPTS = 3  # for a block whose worker was lost
# Each worker is one thread: more would only get in each other's way.
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
# GNU's C library keeps the memory of a run for the next one, up to so many bytes. It would give large arrays back and take them
# anew, page by page: a twentieth of the time of a run.
KEPT = {"MALLOC_TRIM_THRESHOLD_": str(2**28), "MALLOC_MMAP_THRESHOLD_": str(2**25)}

LOADED = ("truenorth.campaign.aligning", "truenorth.campaign.rows")  # what :func:`work` needs


def work(plan: dict[str, Any], block: Block) -> Any:
    """Rows of a block as an Arrow table; what runs in a worker."""
    from truenorth.campaign.aligning import align_runs
    from truenorth.campaign.rows import table_of

    built = _plan_of(_Frozen(plan))
    return table_of(align_runs(built, built.cases[block.case], range(block.first, block.last + 1)))


class _Frozen:
    """A plan's mapping that compares by its text, so that a worker builds each plan once."""

    def __init__(self, mapping: dict[str, Any]) -> None:
        import json

        self.mapping = mapping
        self.text = json.dumps(mapping, sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Frozen) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)


@lru_cache(maxsize=4)
def _plan_of(frozen: _Frozen) -> Plan:
    return read_plan(frozen.mapping)


def in_this_process(plan: Plan, blocks: Sequence[Block]) -> Done:
    """Blocks with their tables, one after the other."""
    mapping = plan.to_mapping()
    for block in blocks:
        yield block, work(mapping, block)


def in_processes(plan: Plan, blocks: Sequence[Block], workers: int) -> Done:
    """Blocks with their tables as they are done, by processes of this machine.

    A worker that dies takes the pool with it: a new pool goes on with what was under way.

    Raises
    ------
    UsageError
        Workers die again and again.
    """
    mapping, left, attempts = plan.to_mapping(), list(blocks), dict.fromkeys(blocks, 0)
    while left:
        with one_thread_each(), pool_of(workers, *LOADED) as pool:
            under_way: dict[Future[Any], Block] = {}
            try:
                while left or under_way:
                    while left and len(under_way) < AHEAD * workers:
                        block = left.pop(0)
                        with uninterrupted():  # the first task starts the workers
                            future = pool.submit(work, mapping, block)
                        under_way[future] = block
                    for future in _first_of(under_way):
                        result = future.result()
                        yield under_way.pop(future), result
            except BrokenProcessPool:
                lost = list(under_way.values())
                for block in lost:
                    attempts[block] += 1
                    if attempts[block] >= ATTEMPTS:
                        raise UsageError(
                            f"worker processes were killed {ATTEMPTS} times on runs {block.first} to {block.last} of case "
                            f"{block.case}; is there enough memory? Fewer `workers` or a smaller block need less"
                        ) from None
                left = lost + left


def _first_of(under_way: Collection[Future[Any]]) -> Collection[Future[Any]]:
    """Those that are done, one at least.

    A second interrupt while Python leaves its wait after the first one finds a lock that is not taken: it is that interrupt still.
    """
    try:
        return wait(under_way, return_when=FIRST_COMPLETED).done
    except RuntimeError as error:
        if isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise


@contextmanager
def pool_of(workers: int, *modules: str) -> Iterator[ProcessPoolExecutor]:
    """A pool of spawned processes, which load modules first.

    An error or an interrupt ends them at once, whatever they are at. A second interrupt meanwhile (the terminal, and `timeout`, may
    send two) is held off until they are gone.
    """
    import multiprocessing

    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=begin, initargs=modules)
    try:
        try:
            yield pool
            pool.shutdown(wait=True, cancel_futures=True)
        except BaseException:
            _end(pool)
            raise
    except BaseException:  # interrupted again, before the lines above could hold it off
        _end(pool)
        raise


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool and wait until they are gone, for a short time only; once more does nothing.

    Without this, one that has just started waits for work that nobody sends, and Python waits for it at its own end.
    """
    with uninterrupted():
        processes = list((getattr(pool, "_processes", None) or {}).values())
        manager = getattr(pool, "_executor_manager_thread", None)
        results = getattr(getattr(pool, "_result_queue", None), "_writer", None)
        pool.shutdown(wait=False, cancel_futures=True)
        for end in ("terminate", "kill"):
            for process in processes:
                getattr(process, end)()
            if _gone(processes, PATIENCE):
                break
        if results is not None:
            with suppress(OSError):
                results.close()  # else the thread that collects results waits for the rest of one that was cut short
        if manager is not None:
            manager.join(PATIENCE)
        for process in processes:
            process.join(0.0)


def _gone(processes: Sequence[BaseProcess], seconds: float) -> bool:
    """Whether all processes end within a time."""
    from multiprocessing.connection import wait as wait_for

    left, last = {process.sentinel for process in processes}, time.monotonic() + seconds
    while left and (now := time.monotonic()) < last:
        left.difference_update(wait_for(list(left), last - now))
    return not left


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold back an interrupt (Ctrl-C) for this process until the block ends, and for the processes started in it for good.

    The terminal interrupts all processes of a command alike; workers that are about to start would each print a traceback. What
    another thread of this process receives, such as one of Arrow's, Python would raise in the main thread all the same: so the
    handler itself only takes note.
    """
    noted: list[int] = []
    main = threading.current_thread() is threading.main_thread()
    handler = signal.getsignal(signal.SIGINT) if main else None  # None also of one that Python does not know
    masked = hasattr(signal, "pthread_sigmask")  # not on Windows
    try:
        if handler is not None:
            signal.signal(signal.SIGINT, lambda number, frame: noted.append(number))
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masked else set()
        try:
            yield
        finally:
            if masked:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
    finally:
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        if noted:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Set for the workers, which read it when they start; how memory is kept, where the user has not said so."""
    wanted = ONE_THREAD | {name: value for name, value in KEPT.items() if name not in os.environ}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def on_cluster(plan: Plan, blocks: Sequence[Block], scheduler: str) -> Done:
    """Blocks with their tables as they are done, by the workers of a Dask cluster, which have truenorth installed.

    A worker that dies is the scheduler's to replace; what it was at is done again.

    Raises
    ------
    UsageError
        Dask is not installed; no scheduler answers, or it goes away; workers die again and again, or have other versions.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
        from distributed.comm import CommClosedError
    except ImportError:
        raise UsageError("a cluster needs Dask: pip install 'truenorth[cluster]'") from None
    try:
        client = Client(scheduler, timeout="5s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise UsageError(f"`scheduler` {scheduler}: no Dask scheduler answers there ({error})") from None
    with client:
        mapping = plan.to_mapping()  # goes with each block: data scattered to workers dies with the last of them
        ahead = AHEAD * max(1, sum(client.nthreads().values()))
        left, here = list(blocks), versions()

        def submit(block: Block) -> Any:
            key = f"{plan.fingerprint[:12]}-{block.shard}"
            return client.submit(work_alike, mapping, block, here, key=key, pure=False, retries=ATTEMPTS)

        under_way = {submit(block): block for block in left[:ahead]}
        left = left[ahead:]
        results = as_completed(list(under_way), loop=client.loop, with_results=True)
        try:
            for future, result in results:
                if future.cancelled():  # what is said in place of a table
                    raise CommClosedError("the connection is lost")
                block = under_way.pop(future)
                if left:
                    following = submit(left[0])
                    under_way[following] = left.pop(0)
                    results.add(following)
                yield block, result
        except KilledWorker as error:
            raise UsageError(
                f"`scheduler` {scheduler}: workers were killed again and again ({error}); is there enough memory? A smaller "
                "block needs less"
            ) from None
        except CommClosedError as error:
            raise UsageError(
                f"`scheduler` {scheduler}: the scheduler went away ({error}); what was done stays: start again with one that runs"
            ) from None


def work_alike(plan: dict[str, Any], block: Block, wanted: dict[str, str]) -> Any:
    """What runs in a worker of another machine: :func:`work`, where all that decides the bits is as wanted.

    Raises
    ------
    UsageError
        It is not.
    """
    other = other_versions(wanted)
    if other:
        raise UsageError(
            f"a worker of the cluster, on {platform.node()}, should have {other}: its numbers would not be those of this machine "
            "to the bit; install the same versions there, or start the campaign on a machine like it"
        )
    return work(plan, block)
