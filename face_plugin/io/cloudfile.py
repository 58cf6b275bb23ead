"""What a file of points holds, and the pieces that every format needs to write one."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "CloudFile", "columns", "format_column", "interleave", "malformed", "replacing"]

Array = NDArray[Any]


@dataclass(frozen=True)
class CloudFile:
    """The content of a point cloud file.

    Attributes
    ----------
    points : (n, 3) array, or (n, 2) in the plane
        Coordinates in the file's own unit and dtype.
    normals : (n, d) array or None
        Normals which the file holds, not checked.
    attributes : dict of str to (n,) or (n, k) array
        Every other value a point has (colour, intensity, label, ...), as it stands in the file.
    suffix : str
        Extension of the file it was read from, lower case with its dot.
    viewpoints : (k, 3) float64 array or None
        Where the scanner stood, in the frame and unit of the points, where the file says so.
    problems : tuple of str
        What was left out because it could not be read.
    source : object
        What the format's writer needs to keep the rest (faces, comments, byte order). Not for users.

    Examples
    --------
    >>> import numpy as np
    >>> CloudFile(np.zeros((2, 3))).points.shape
    (2, 3)
    """

    points: Array
    normals: Array | None = None
    attributes: Mapping[str, Array] = field(default_factory=dict)
    suffix: str = ""
    viewpoints: NDArray[np.float64] | None = None
    problems: tuple[str, ...] = ()
    source: Any = field(default=None, repr=False)

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)


def malformed(path: Path, kind: str, found: object) -> ValueError:
    """Make the error of a file which is not what its extension says."""
    detail = " ".join(str(found).split()) or type(found).__name__
    return ValueError(f"{path}: not a readable {kind} file: {detail}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`, else it is removed.

    The temporary keeps the extension, because some writers choose the format by it. The name is fixed before
    anything is created, so that an interrupt at any moment finds it.
    """
    # A symbolic link stays one: what it points to is replaced.
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.stem}.{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        yield temporary
        if target.exists():
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except OSError as error:
        if error.filename not in (None, str(temporary)):
            raise
        # A full disk names no file at all, and of the temporary one nobody has heard.
        reason = error.strerror or str(error)
        if not target.parent.is_dir():
            reason = f"there is no folder {target.parent}"
        if error.errno is None:
            raise OSError(f"{path}: cannot be written: {reason}") from error
        raise OSError(error.errno, reason, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def columns(
    cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None
) -> tuple[Array, Array | None, dict[str, Array]]:
    """Return points, normals and one-column attributes of the points to write, whatever the source was."""
    attributes: dict[str, Array] = {}
    for name, values in {**cloud.attributes, **extra}.items():
        if values.ndim == 1:
            attributes[name] = values
        else:
            flat = values.reshape(len(values), -1)
            attributes.update({f"{name}_{k}": flat[:, k] for k in range(flat.shape[1])})
    if normals is None:
        normals = cloud.normals
    if keep is None:
        return cloud.points, normals, attributes
    kept = {name: values[keep] for name, values in attributes.items()}
    return cloud.points[keep], None if normals is None else normals[keep], kept


def format_column(values: Array) -> list[str]:
    """Format numbers as the shortest text that reads back to the same value of the same dtype."""
    if values.dtype == bool:
        values = values.astype(np.uint8)
    if values.dtype == np.float64:
        return list(map(repr, values.tolist()))
    if values.dtype.kind in "iu":
        return list(map(str, values.tolist()))
    strings: list[str] = values.astype(str).tolist()
    return strings


def interleave(cols: list[list[str]], separator: str, prefix: str = "") -> str:
    """Join columns of text into lines; an empty string for no rows, else a closing newline."""
    if not cols or not cols[0]:
        return ""
    return prefix + f"\n{prefix}".join(map(separator.join, zip(*cols, strict=True))) + "\n"
