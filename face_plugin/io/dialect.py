"""How a text file of points is laid out: encoding, comments, delimiter, decimal sign, names of columns."""

from __future__ import annotations

import csv
import logging
import re
from dataclasses import dataclass
from pathlib import Path

from face_plugin.io.cloudfile import malformed
from face_plugin.io.names import axes_of, is_known, is_time, meanings

__all__ = ["COMMENT", "Layout", "Sheet", "decoded", "is_number", "open_sheet", "split"]

log = logging.getLogger(__name__)

COMMENT = ("#", "//", ";;", "%", "!", "/*")
_DELIMITERS = (";", "\t", "|", ",")
# Text whose extension does not promise three coordinates.
PLANE_TEXT = (".txt", ".csv", ".asc")
# Lines to look for the first coordinates in: no preamble of a text file is as long.
_PREAMBLE = 10_000
# Rows in which a decimal comma is looked for: whole numbers have none.
_PROBE = 1000
_DIGIT, _WORD = re.compile(r"\d"), re.compile(r"\w+")
_FORTRAN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)[dD][+-]?\d+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Layout:
    """How the lines of a file look, so that it can be written alike."""

    delimiter: str | None = None
    """None: blanks."""
    head: tuple[str, ...] = ()
    """Lines before the data as they stand, the one with the column names left out."""
    names: tuple[str, ...] = ()
    """Name of each column, in the file's order."""
    header: str | None = None
    """What stands before the column names ('' or a comment sign), or None where the file has no names."""
    counted: bool = False
    """The first line is the number of points (PTS)."""
    quoted: bool = False
    """Column names stand in quotes."""
    comma: bool = False
    """Decimals stand behind a comma."""


@dataclass(frozen=True)
class Sheet:
    """The lines of the data and what is known of them; `names` is empty where the file has none."""

    layout: Layout
    lines: list[str]
    numbers: list[int] | range
    """Number of each line in the file, from 1."""
    width: int


def decoded(path: Path, kind: str) -> str:
    """Return a file's text: UTF-8, UTF-16 with its mark, else Latin-1; ValueError for what is no text."""
    content = path.read_bytes()
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        try:
            return content.decode("utf-16")
        except UnicodeDecodeError as error:
            raise malformed(path, kind, f"not text: {error}") from error
    if b"\0" in content:
        raise malformed(path, kind, f"not text: a zero byte at {content.index(0)}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def is_number(word: str) -> bool:
    """Whether `float` takes the word, or would with E for Fortran's D."""
    try:
        float(word)
    except ValueError:
        return _FORTRAN.fullmatch(word) is not None
    return True


def split(line: str, layout: Layout) -> list[str]:
    """Return the words of a line, numbers with a decimal point, quotes taken off."""
    text = line.strip() if layout.delimiter is None else line.strip(" \r\n")
    if '"' in text:
        words = next(csv.reader([text], delimiter=layout.delimiter or " ", skipinitialspace=True), [])
        if layout.delimiter is None:
            words = [word for word in words if word]
    else:
        words = text.split(layout.delimiter)
    words = [word.strip() for word in words]
    if layout.comma:
        words = [word.replace(",", ".") if _DECIMAL_COMMA.fullmatch(word) else word for word in words]
    return words


def open_sheet(path: Path) -> Sheet:
    """Read a text file and find out how it is laid out.

    Raises
    ------
    ValueError
        It is not text, or has no line with coordinates, or as many names as columns.
    """
    # Old systems end a text with a sign of its own.
    lines = decoded(path, "text").rstrip("\x1a").splitlines()
    first, layout = _first_row(path, lines)
    words = _words(lines[first], layout)
    # A delimiter may end each row, or the last value of the first row be missing: the names decide.
    widths = (len(words) - (words[-1] == ""), len(words))
    counted = any(line.strip().isdigit() for line in lines[:first][-1:])
    head, names, header, quoted = _header(path, lines[: first - counted], layout, widths)
    rows, numbers = _rows(lines, first, counted)
    if header is not None and any(meanings(_WORD.findall(row)) for row in rows if not _DIGIT.search(row)):
        # Files that were put together repeat their names.
        kept = [k for k, row in enumerate(rows) if _DIGIT.search(row)]
        rows, numbers = [rows[k] for k in kept], [numbers[k] for k in kept]
    comma = layout.comma or (layout.delimiter != "," and any(map(_has_decimal_comma, rows[:_PROBE])))
    layout = Layout(layout.delimiter, head, names, header, counted, quoted, comma)
    if comma:
        log.info("%s: decimals behind a comma", path)
    if counted and int(lines[first - 1]) > len(rows):
        promised = lines[first - 1].strip()
        log.warning("%s: line %d promises %s points, the file has %d", path, first, promised, len(rows))
    return Sheet(layout, rows, numbers, len(names) or widths[0])


def _has_decimal_comma(line: str) -> bool:
    return "," in line and any(_DECIMAL_COMMA.fullmatch(word) for word in re.split(r"[;|\s]+", line.strip()))


def _rows(lines: list[str], first: int, counted: bool) -> tuple[list[str], list[int] | range]:
    """Lines of data from the first on, without blank lines, comments and counts of further scans."""
    data = lines[first:]
    plain = all(sign not in line for line in data for sign in COMMENT) and not counted
    if plain and all(map(str.strip, data)):
        return data, range(first + 1, len(lines) + 1)
    rows, numbers = [], []
    for k, line in enumerate(data, first + 1):
        text = line.strip()
        if text and not text.startswith(COMMENT) and not (counted and text.isdigit()):
            rows.append(_uncommented(line))
            numbers.append(k)
    return rows, numbers


def _uncommented(line: str) -> str:
    for sign in ("#", "//"):
        if sign in line and '"' not in line:
            line = line.split(sign, 1)[0].rstrip()
    return line


def _words(line: str, layout: Layout) -> list[str]:
    return split(_uncommented(line), layout)


def _first_row(path: Path, lines: list[str]) -> tuple[int, Layout]:
    """Find the first line with three numbers or more, and how it is delimited; two are points in the plane."""
    short = None
    for k, line in enumerate(lines[:_PREAMBLE]):
        text = line.strip()
        if not text or text.startswith(COMMENT):
            continue
        layout = _delimited(_uncommented(line))
        words = _words(line, layout)
        if sum(map(is_number, words)) >= 3:
            return k, layout
        if short is None and words and all(map(is_number, words)):
            short = (k, words, layout)
    if short is not None:
        k, words, layout = short
        if len(words) == 2 and path.suffix.lower() in PLANE_TEXT:
            return k, layout
        found = f"line {k + 1} has {len(words)} columns ({lines[k][:60]!r}), expected 3 or more"
        raise malformed(path, "text", found)
    raise malformed(path, "text", "no line with coordinates")


def _delimited(line: str) -> Layout:
    """Return the delimiter that gives most numbers, of equals the first; a comma may be the decimal sign."""
    best, most = Layout(), -1
    blanks = line.split()
    decimal = any(d in line for d in _DELIMITERS[:3]) or len(blanks) >= 3
    for layout in [
        *(Layout(d) for d in _DELIMITERS if d in line),
        Layout(),
        *(Layout(d, comma=True) for d in (*_DELIMITERS[:3], None) if decimal and "," in line and (not d or d in line)),
        *([Layout(",", comma=True)] if '"' in line else []),
    ]:
        words = split(line, layout)
        count = sum(map(is_number, words))
        # "1,5 2,5 3,5" cut at its commas has words of two numbers, which are none.
        if count > most and (count == len(words) or count >= 3 or most < 0):
            best, most = layout, count
    return best


def _header(
    path: Path, lines: list[str], layout: Layout, widths: tuple[int, int]
) -> tuple[tuple[str, ...], tuple[str, ...], str | None, bool]:
    """Lines before the data: those to keep, the names of the columns, their sign, and whether in quotes."""
    filled = [k for k, line in enumerate(lines) if line.strip()]
    # The last line, if it is no comment, else any comment: nearest to the data first.
    for k in reversed(filled):
        sign = re.match(r"\s*(#+|//+|;;|%+|!+|/\*+)\s*", lines[k])
        text = lines[k][sign.end() :] if sign else lines[k]
        names = _names(text, layout, widths)
        found = meanings(names)
        complete = all(axis in found for axis in axes_of(found))
        known = sum(map(is_known, names))
        titled = not sign and k == filled[-1]
        if len(names) in widths and names and (complete or titled or known >= 2 or is_time(names[0])):
            head = tuple(line for row, line in enumerate(lines) if row != k and (row < k or line.strip()))
            return head, tuple(names), sign.group(0) if sign else "", '"' in text
        timed = complete and any(map(is_time, _WORD.findall(text)))
        if len(names) not in widths and ((not sign and known >= 2) or (sign and timed)):
            found_names = f"{len(names)} column names for {widths[0]} columns: {names}"
            raise malformed(path, "text", f"line {k + 1}: {found_names}")
        if not sign:
            log.info("%s: line %d is taken for a title: %r", path, k + 1, lines[k][:60])
    return tuple(lines), (), None, False


def _names(text: str, layout: Layout, widths: tuple[int, int]) -> list[str]:
    """Words of a line of names, delimited as the data or in another way that gives as many."""
    best: list[str] = []
    for delimiter in dict.fromkeys((layout.delimiter, *_DELIMITERS, None)):
        if delimiter is not None and delimiter not in text:
            continue
        names = [word.strip("\"'") for word in split(text, Layout(delimiter))]
        if names and not names[-1]:
            names.pop()
        if any(map(is_number, names)) or len(set(names)) < len(names):
            continue
        if len(names) in widths:
            return names
        best = best or names
    # Names of several words stand apart by more than one blank.
    apart = re.split(r"\s{2,}|\t", text.strip())
    return apart if len(apart) in widths and not any(map(is_number, apart)) else best
