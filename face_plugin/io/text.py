"""Points in columns of text: XYZ, TXT, CSV, ASC, PTS; see `dialect` for how their layout is found out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from face_plugin.io.cloudfile import Array, CloudFile, columns, format_column, interleave, malformed
from face_plugin.io.dialect import Layout, Sheet, is_number, open_sheet, split
from face_plugin.io.names import COLOUR, NORMAL, POINT, axes_of, guess_names, is_known, meanings, with_colours


def read(path: Path) -> CloudFile:
    """Read a text file of points; see `face_plugin.io.read_cloud`."""
    sheet = open_sheet(path)
    suffix = path.suffix.lower()
    table = _parse(path, sheet)
    layout = sheet.layout
    names = list(layout.names) or guess_names(table, suffix=suffix)
    found = meanings(names)
    at = {meaning: names.index(name) for meaning, name in found.items()}
    unknown = [k for k, name in enumerate(names) if table[k].dtype.kind in "fiu" and not is_known(name)]
    axes = axes_of(found, rest=len(unknown))
    if any(axis not in at or table[at[axis]].dtype.kind not in "fiu" for axis in axes):
        raise malformed(path, "text", f"columns {names}: no numbers under x, y, z")
    of_normal = NORMAL[: len(axes)]
    has_normals = all(n in at and table[at[n]].dtype.kind in "fiu" for n in of_normal)
    used = {at[n] for n in (*axes, *(of_normal if has_normals else ()))}
    layout = Layout(**{**vars(layout), "names": tuple(names)})
    return CloudFile(
        points=np.stack([table[at[n]].astype(np.float64) for n in axes], axis=1),
        normals=np.stack([table[at[n]] for n in of_normal], axis=1) if has_normals else None,
        attributes={name: table[k] for k, name in enumerate(names) if k not in used},
        suffix=suffix,
        source=layout,
    )


def _parse(path: Path, sheet: Sheet) -> list[Array]:
    """Parse the data lines into one array a column: integers, floats, or text."""
    layout, width, data = sheet.layout, sheet.width, sheet.lines
    plain = '"' not in data[0] and not (layout.comma and layout.delimiter == ",")
    if plain:
        try:
            points = [line.replace(",", ".") for line in data] if layout.comma else data
            table = np.loadtxt(points, dtype=np.float64, delimiter=layout.delimiter, ndmin=2, comments=None)
            first = split(data[0], layout)
            return [_narrow(table[:, c], first[c], points, layout.delimiter, c) for c in range(width)]
        except ValueError:
            pass
    words = []
    for k, line in zip(sheet.numbers, data, strict=True):
        row = split(line, layout)
        if len(row) == width + 1 and not row[-1]:
            row.pop()
        if len(row) != width:
            found = f"line {k} has {len(row)} columns, line {sheet.numbers[0]} has {width}"
            raise malformed(path, "text", found)
        words.append(row)
    return [_column(path, list(column), sheet.numbers) for column in zip(*words, strict=True)]


def _column(path: Path, words: list[str], numbers: list[int] | range) -> Array:
    """Turn one column into numbers, or keep it as text where its first word is none; nothing is NaN."""
    filled = [word for word in words if word]
    try:
        values = np.array([word or "nan" for word in words], dtype=np.float64)
    except ValueError:
        if filled and not is_number(filled[0]):
            return np.array(words)
        try:
            # Fortran writes 1.0D+05.
            return np.array([word.upper().replace("D", "E") or "nan" for word in words], dtype=np.float64)
        except ValueError:
            k = next(k for k, word in enumerate(words) if word and not is_number(word))
            raise malformed(path, "text", f"line {numbers[k]}: {words[k][:40]!r} is not a number") from None
    if not filled:
        return np.array(words)
    if len(filled) == len(words) and all(word.lstrip("+-").isdigit() for word in words):
        try:
            return np.array(words, dtype=np.int64)
        except (ValueError, OverflowError):
            return values
    return values


def _narrow(values: Array, first: str, data: list[str], delimiter: str | None, column: int) -> Array:
    """Turn whole numbers back into integers, so that a label 3 is not written as 3.0."""
    if not first.lstrip("+-").isdigit() or not np.all(np.isfinite(values)) or np.any(values != np.rint(values)):
        return values
    if np.abs(values).max() < 2.0**53:
        return values.astype(np.int64)
    try:
        return np.loadtxt(data, dtype=np.int64, delimiter=delimiter, usecols=column, ndmin=1, comments=None)
    except (ValueError, OverflowError):
        return values


def write(path: Path, cloud: CloudFile, normals: Array | None, extra: Mapping[str, Array], keep: Array | None) -> None:
    """Write a text file of points; see `face_plugin.io.write_cloud`."""
    points, normals, attributes = columns(cloud, normals, extra, keep)
    layout = cloud.source
    # Places of columns mean something in these; other text may look as the file that was read.
    fixed = {".pts", ".xyzrgb"} & {path.suffix.lower(), cloud.suffix}
    if not isinstance(layout, Layout) or (fixed and path.suffix.lower() != cloud.suffix):
        layout, attributes = _fresh(path.suffix.lower(), attributes, POINT[: points.shape[1]])
    of_normal = NORMAL[: points.shape[1]]
    if points.shape[1] == 2 and normals is not None and layout.header is None:
        # Without names four columns are points in space, and something more.
        layout = replace(layout, header="# ")
    found = meanings(layout.names)
    meaning = {name: key for key, name in found.items()}
    has_normals = all(n in found for n in of_normal)
    values: dict[str, Array] = {}
    for name in layout.names:
        if meaning.get(name) in POINT:
            values[name] = points[:, POINT.index(meaning[name])]
            if meaning[name] == POINT[points.shape[1] - 1] and normals is not None and not has_normals:
                values.update({n: normals[:, k] for k, n in enumerate(of_normal)})
        elif meaning.get(name) in of_normal and has_normals and normals is not None:
            values[name] = normals[:, NORMAL.index(meaning[name])]
        else:
            values[name] = attributes[name]
    values.update({name: column for name, column in attributes.items() if name in extra})
    separator = layout.delimiter or " "
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(line + "\n" for line in layout.head)
        if layout.counted:
            stream.write(f"{len(points)}\n")
        if layout.header is not None:
            # Where blanks part the columns, names have none.
            names = list(values) if layout.delimiter else ["_".join(name.split()) for name in values]
            names = [f'"{name}"' for name in names] if layout.quoted else names
            stream.write(layout.header + separator.join(names) + "\n")
        stream.write(interleave([_cells(column, layout) for column in values.values()], separator))


def _fresh(suffix: str, attributes: dict[str, Array], axes: tuple[str, ...]) -> tuple[Layout, dict[str, Array]]:
    """Layout of a file that is made anew: CSV has names, PTS a count and intensity before the colours."""
    comma = suffix == ".csv"
    names = [*axes, *attributes]
    if suffix in (".pts", ".xyzrgb"):
        attributes = with_colours(attributes)
        first = ["intensity"] if suffix == ".pts" else []
        if all(c in attributes for c in COLOUR):
            first += COLOUR
            if suffix == ".xyzrgb":
                attributes.update({c: np.round(attributes[c] / 255.0, 5) for c in COLOUR})
        names = [*axes, *(n for n in first if n in attributes), *(n for n in attributes if n not in first)]
    layout = Layout("," if comma else None, (), tuple(names), "" if comma else None, suffix == ".pts")
    return layout, attributes


def _cells(values: Array, layout: Layout) -> list[str]:
    cells = format_column(values)
    if layout.comma and values.dtype.kind == "f":
        sign = '"' if layout.delimiter == "," else ""
        return [sign + cell.replace(".", ",") + sign for cell in cells]
    if values.dtype.kind == "U" and layout.delimiter:
        return [f'"{cell}"' if layout.delimiter in cell or '"' in cell else cell for cell in cells]
    return cells
