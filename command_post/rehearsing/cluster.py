"""Work spread over a Dask cluster, whose machines have this project installed.

Dask comes with the extra ``cluster``, and is imported only where a cluster is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

CONNECT_S = 10
LEAVE_S = 1.0


class ClusterError(RuntimeError):
    """There is no such cluster, or nothing to reach it with. The text says what to do."""


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Give an executor on the Dask cluster whose scheduler is at ``address``.

    What is still waited for when the caller gives up is cancelled. Raises ``ClusterError``.
    """
    try:
        from distributed import Client  # noqa: PLC0415
    except ImportError:
        raise ClusterError("no Dask here: install the extra, as in pip install 'clew[cluster]'"
                           ) from None  # fmt: skip
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"no Dask scheduler at {address} ({error}); start one, or give its address, "
            "as in tcp://10.0.0.1:8786"
        ) from error
    try:
        executor: Executor = client.get_executor(pure=False)
        try:
            yield executor
        except BaseException:
            executor.shutdown(wait=False)
            raise
        executor.shutdown()
    finally:
        client.close(timeout=LEAVE_S)
