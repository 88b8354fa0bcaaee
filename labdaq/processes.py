"""Processes that work for another one."""

import multiprocessing
import os
import threading


def end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, however that ended; to be called first in it.

    A pool's processes wait for work, and go on with what they were given, when the one that owns the pool is killed.
    Without a parent (a process that `multiprocessing` did not start) nothing is done.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, name="end-with-parent", daemon=True).start()
