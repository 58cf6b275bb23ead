"""What stands between a file and its disk: room that is really there, locks, and errors that name the file."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

__all__ = ["allocated", "claimed", "naming"]

log = logging.getLogger(__name__)

# Bytes written at a time where the system cannot reserve them.
BLOCK = 1 << 20
# Seconds in which the workers of a killed run notice that they are orphans; they write, and hold its lock, until then.
PATIENCE = 2.0
_CANNOT = {errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK}


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Give an error that names no file, as that of a full disk does not, the name of the file that is written.

    Examples
    --------
    >>> with naming(Path("out.ply")):
    ...     raise OSError(errno.ENOSPC, "No space left on device")
    Traceback (most recent call last):
    OSError: [Errno 28] No space left on device: 'out.ply'
    """
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror or os.strerror(error.errno), str(path)) from error


def allocated(path: Path, dtype: DTypeLike, shape: tuple[int, ...]) -> np.memmap[Any, Any]:
    """Make an NPY file whose every byte has its place on the disk, and map it.

    A sparse file, once mapped, ends the process by a signal when the disk turns out to be full.

    Parameters
    ----------
    path : Path
    dtype : dtype
    shape : tuple of int
        None of them 0.

    Raises
    ------
    OSError
        There is no room for it; with the file's name.

    Examples
    --------
    >>> import tempfile
    >>> allocated(Path(tempfile.mkdtemp()) / "zeros.npy", np.float32, (2, 3)).sum().item()
    0.0
    """
    dtype = np.dtype(dtype)
    header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    with naming(path):
        with open(path, "wb") as stream:
            np.lib.format.write_array_header_1_0(stream, header)
            stream.flush()
            _reserve(stream.fileno(), stream.tell(), int(np.prod(shape, dtype=np.int64)) * dtype.itemsize)
        mapped: np.memmap[Any, Any] = np.load(path, mmap_mode="r+")
        return mapped


def _reserve(file: int, start: int, size: int) -> None:
    """Let a file have `size` bytes of zeros from `start`, its end."""
    if sys.platform == "linux":
        try:
            os.posix_fallocate(file, start, size)
            return
        except OSError as error:
            if error.errno not in _CANNOT:
                raise
    left = size
    while left > 0:
        left -= os.write(file, bytes(min(left, BLOCK)))


@contextmanager
def claimed(lock: Path, output: Path) -> Iterator[None]:
    """Be the only one who writes `output`, in this process and among all of this machine.

    The lock goes with the process that holds it, however that ends; its workers share it.

    Parameters
    ----------
    lock : Path
        File that stands for the right to write; removed afterwards.
    output : Path
        What is written, for the message.

    Raises
    ------
    BlockingIOError
        Another run is writing it.

    Examples
    --------
    >>> import tempfile
    >>> lock = Path(tempfile.mkdtemp()) / ".out.lock"
    >>> with claimed(lock, Path("out.npy")):
    ...     lock.exists()
    True
    >>> lock.exists()
    False
    """
    until = time.monotonic() + PATIENCE
    while (file := _taken(lock)) is None:
        if time.monotonic() > until:
            raise BlockingIOError(f"another run is writing {output}")
        time.sleep(0.1)
    try:
        yield
    finally:
        if sys.platform != "win32":
            # Removed while it is held: who opened it meanwhile will find that it is not the one under this name.
            lock.unlink(missing_ok=True)
            _lock(file, take=False)
            os.close(file)
        else:
            os.close(file)
            with contextlib.suppress(OSError):
                lock.unlink()


def _taken(path: Path) -> int | None:
    """Open and lock a file, and return it; None if another has it."""
    file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0))
    try:
        _lock(file, take=True)
        if sys.platform == "win32" or os.path.samestat(os.fstat(file), os.stat(path)):
            return file
    except (BlockingIOError, PermissionError, FileNotFoundError):
        pass
    except OSError as error:
        if error.errno in _CANNOT:
            log.warning("%s: no locks on this file system: a second run into one output would go unnoticed", path)
            return file
        os.close(file)
        raise
    os.close(file)
    return None


def _lock(file: int, *, take: bool) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK if take else msvcrt.LK_UNLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB if take else fcntl.LOCK_UN)
