"""Many alike computations side by side: over processes of this machine, or over a Dask cluster whose address is given."""

import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from gravcomp.config import ConfigError


class Sweep:
    """`map(function, items)`: the results in the order of the items. Function and items have to be picklable.

    workers: processes (None: one a core; 1: this process alone); cluster: address of a Dask scheduler, as 'tcp://host:8786'.
    """

    def __init__(self, workers: int | None = None, cluster: str | None = None):
        if workers is not None and workers < 1:
            raise ConfigError(f"workers is {workers}; 1 or more are needed")
        self.workers = workers or len(os.sched_getaffinity(0))
        self.cluster = cluster
        self._pool: Any = None

    @property
    def place(self) -> str:
        """Where the computations run, for reports."""
        if self.cluster:
            return f"Dask cluster at {self.cluster}"
        return f"{self.workers} processes" if self.workers > 1 else "one process"

    def map(self, function: Callable, items: Iterable, done: Callable[[int, int], None] | None = None) -> list:
        """[function(item) for item in items]; `done(count, total)` is told after each."""
        items = list(items)
        results: list = []
        for result in self._results(function, items):
            results.append(result)
            if done is not None:
                done(len(results), len(items))
        return results

    def _results(self, function: Callable, items: Sequence) -> Iterable:
        if self.cluster:
            client = self._client()
            return (future.result() for future in client.map(function, items))
        if self.workers == 1 or len(items) == 1:
            return map(function, items)
        return self._processes().map(function, items)

    def _processes(self) -> Any:
        if self._pool is None:
            import concurrent.futures
            import multiprocessing

            # Spawned, not forked: threads of numerical libraries do not survive a fork.
            context = multiprocessing.get_context("spawn")
            self._pool = concurrent.futures.ProcessPoolExecutor(self.workers, mp_context=context, initializer=_one_thread)
        return self._pool

    def _client(self) -> Any:
        if self._pool is None:
            try:
                from dask.distributed import Client
            except ImportError as error:
                raise ConfigError(
                    "a Dask cluster is asked for and the package 'distributed' is not installed: pip install distributed"
                ) from error
            try:
                self._pool = Client(self.cluster, timeout=10)
            except (OSError, TimeoutError, ValueError) as error:
                raise ConfigError(f"the Dask cluster at {self.cluster} does not answer: {error}") from error
        return self._pool

    def close(self) -> None:
        """End the processes, or leave the cluster."""
        if self._pool is not None:
            self._pool.close() if self.cluster else self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def __enter__(self) -> "Sweep":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _one_thread() -> None:
    """A process a core: more threads would only wait for one another."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
