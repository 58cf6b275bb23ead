"""Hold what LAS and LAZ headers claim against the file, before a library believes it.

A damaged chunk table makes the decoder ask for any amount of memory, and abort the process when it does not get
it. So a LAZ is first decoded once in a process of its own, whose end is no harm.
"""

from __future__ import annotations

import logging
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import BinaryIO

from face_plugin.child import environment, failure

__all__ = ["check_las"]

log = logging.getLogger(__name__)

_HEADER, _VLR, _EVLR = 227, 54, 60
_COMPRESSED = 0x80
_VARIABLE = 0xFFFFFFFF
# A chunk begins with a point as it is; the shortest records have 20 bytes.
_LEAST_CHUNK = 20
# Points that a byte may stand for where chunks have no fixed length: equal points, measured, make 137 of a byte in
# chunks of 50,000, and more in longer ones.
_MOST_RATIO = 10_000
_LASZIP = b"laszip encoded"
# Scans unpack to 6 to 11 times their size (measured on random walks); what takes much more memory is told.
_USUAL_RATIO = 20
# What the decoder may take beside the points: its buffers for one chunk a core, and the interpreter's.
_DECODER_BYTES = 1 << 30


def check_las(path: Path) -> None:
    """Raise ValueError where the header or the compressed points of a LAS or LAZ file cannot be right.

    Parameters
    ----------
    path : Path

    Raises
    ------
    ValueError
        Without the path: the caller adds it.
    OSError
        The file cannot be opened.
    """
    size = path.stat().st_size
    with open(path, "rb") as stream:
        head = stream.read(375)
        if len(head) < _HEADER or head[:4] != b"LASF":
            raise ValueError("no LAS header at its beginning")
        header_size, start, vlrs = struct.unpack_from("<HII", head, 94)
        form, record, count = head[104], *struct.unpack_from("<HI", head, 105)
        if not _HEADER <= header_size <= start <= size:
            raise ValueError(f"header of {header_size} bytes, points from byte {start}, in a file of {size} bytes")
        found = _walk(stream, vlrs, header_size, start, _VLR, "<H")
        if head[25] >= 4 and len(head) == 375 and header_size >= 375:
            first, evlrs = struct.unpack_from("<QI", head, 235)
            count = struct.unpack_from("<Q", head, 247)[0]
            _walk(stream, evlrs, first, size, _EVLR, "<Q")
        if not record:
            raise ValueError("records of 0 bytes")
        if not form & _COMPRESSED:
            if count * record > size - start:
                raise ValueError(f"{count} points of {record} bytes from byte {start}, in a file of {size} bytes")
            return
        if _LASZIP not in found:
            raise ValueError("compressed points, but no record that says how")
        stream.seek(found[_LASZIP] + _VLR + 12)
        _check_chunks(stream, size, start, count, int.from_bytes(stream.read(4), "little"))
    if count * record > _USUAL_RATIO * size:
        log.warning("%s: unpacks to %.3g MB, %d times its size", path, count * record / 1e6, count * record // size)
    _decode_elsewhere(path, count * record)


def _walk(stream: BinaryIO, count: int, at: int, end: int, head: int, kind: str) -> dict[bytes, int]:
    """Go from record to record of a chain that claims `count` of them between two places: where each owner's is."""
    if count and count * head > end - at:
        raise ValueError(f"{count} variable length records between bytes {at} and {end}")
    found: dict[bytes, int] = {}
    for k in range(count):
        stream.seek(at + 2)
        found[stream.read(16).rstrip(b"\0")] = at
        stream.seek(2, os.SEEK_CUR)
        raw = stream.read(struct.calcsize(kind))
        length = struct.unpack(kind, raw)[0] if len(raw) == struct.calcsize(kind) else end
        at += head + length
        if at > end:
            raise ValueError(f"variable length record {k + 1} of {count} ends at byte {at}, beyond {end}")
    return found


def _check_chunks(stream: BinaryIO, size: int, start: int, count: int, length: int) -> None:
    """Compare the number of chunks with the bytes that they could have."""
    stream.seek(start)
    raw = stream.read(8)
    if len(raw) < 8:
        raise ValueError("no chunk table: early end-of-file")
    table = struct.unpack("<q", raw)[0]
    if table == -1:
        # Written as a stream: the place of the table stands at the end.
        stream.seek(size - 8)
        table = struct.unpack("<q", stream.read(8))[0]
    if not start + 8 <= table <= size - 8:
        raise ValueError(f"chunk table at byte {table} of {size}")
    stream.seek(table)
    chunks = struct.unpack("<II", stream.read(8))[1]
    most = chunks * length if length != _VARIABLE else size * _MOST_RATIO
    if chunks * _LEAST_CHUNK > table - start or count > most:
        raise ValueError(f"{chunks} chunks for {count} points in {table - start} bytes")


def _decode_elsewhere(path: Path, unpacked: int) -> None:
    if not sys.executable:
        return
    command = [sys.executable, "-m", "face_plugin.io._las_worker", os.path.abspath(path)]
    command.append(str(_DECODER_BYTES + 4 * unpacked))
    try:
        child = subprocess.run(
            command,
            env=environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
        )
    except OSError as error:
        # No process to be had: a sound file must still be read.
        log.info("%s: not decoded beforehand (%s)", path, error)
        return
    if child.returncode:
        raise ValueError(f"its compressed points cannot be decoded: the decoder {failure(child)}")
