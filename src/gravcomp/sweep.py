"""Independent computations in parallel: in processes on this machine, or on a Dask cluster."""

import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from gravcomp.config import ConfigError


class Sweep:
    """Parallel `map(function, items)`. Function and items must be picklable.

    workers: number of processes (None: one per core; 1: this process only); cluster: address of a Dask scheduler, as
    'tcp://host:8786'. Raises ConfigError when `workers` is less than 1.
    """

    def __init__(self, workers: int | None = None, cluster: str | None = None):
        if workers is not None and workers < 1:
            raise ConfigError(f"workers is {workers}; 1 or more is needed")
        self.workers = workers or len(os.sched_getaffinity(0))
        self.cluster = cluster
        self._pool: Any = None

    @property
    def place(self) -> str:
        """Description of where the computations run, for reports."""
        if self.cluster:
            return f"Dask cluster at {self.cluster}"
        return f"{self.workers} processes" if self.workers > 1 else "one process"

    def map(self, function: Callable, items: Iterable, done: Callable[[int, int], None] | None = None) -> list:
        """Return [function(item) for item in items], in this order; `done(count, total)` is called after each.

        Raises ConfigError when the cluster cannot be used.
        """
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

            # Spawned, not forked: the threads of numerical libraries do not survive a fork.
            context = multiprocessing.get_context("spawn")
            self._pool = concurrent.futures.ProcessPoolExecutor(self.workers, mp_context=context, initializer=_one_thread)
        return self._pool

    def _client(self) -> Any:
        if self._pool is None:
            try:
                from dask.distributed import Client
            except ImportError as error:
                raise ConfigError(
                    "a Dask cluster needs the package 'distributed', which is not installed: pip install distributed"
                ) from error
            try:
                self._pool = Client(self.cluster, timeout=10)
            except (OSError, TimeoutError, ValueError) as error:
                raise ConfigError(f"the Dask cluster at {self.cluster} does not answer: {error}") from error
        return self._pool

    def close(self) -> None:
        """End the processes, or disconnect from the cluster."""
        if self._pool is not None:
            self._pool.close() if self.cluster else self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def __enter__(self) -> "Sweep":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _one_thread() -> None:
    """Use one thread per process: with one process per core, more threads would only wait for each other."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
