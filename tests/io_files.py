"""Small files of every format and dialect, made anew: name -> content, all of the same 40 points."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable

import numpy as np

RNG = np.random.default_rng(5)
COUNT = 40
POINTS = np.round(RNG.normal(size=(COUNT, 3)) * 3 + [500_000.0, 600_000.0, 100.0], 3)
NORMALS = RNG.normal(size=(COUNT, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
RGB = RNG.integers(0, 256, (COUNT, 3))
RGB[0] = 255
TIMES = np.arange(COUNT)


def rows(form: str, *columns: np.ndarray) -> list[str]:
    return [form % tuple(row) for row in np.column_stack(columns)]


def lines(*parts: str | list[str]) -> str:
    return "\n".join("\n".join(part) if isinstance(part, list) else part for part in parts) + "\n"


XYZ = rows("%.3f %.3f %.3f", POINTS)
CSV = rows("%.3f,%.3f,%.3f", POINTS)
SEMI = rows("%.3f;%.3f;%.3f", POINTS)
DECIMAL = [row.replace(".", ",") for row in SEMI]

TEXT: dict[str, str | bytes] = {
    "plain.xyz": lines(XYZ),
    "crlf.xyz": lines(XYZ).replace("\n", "\r\n"),
    "old_mac.xyz": lines(XYZ).replace("\n", "\r"),
    "indented.xyz": lines(["   " + row for row in XYZ]),
    "many_blanks.xyz": lines([row.replace(" ", "     ") for row in XYZ]),
    "comment_between.xyz": lines(XYZ[:20], "# second scan", XYZ[20:]),
    "comment_behind.xyz": lines([row + "  # a point" for row in XYZ]),
    "blank_lines.xyz": lines("", XYZ[:7], "", "", XYZ[7:], ""),
    "fortran.xyz": lines(rows("%.9E %.9E %.9E", POINTS)).replace("E", "D"),
    "title.txt": lines("Survey of Monday 3", XYZ),
    "title_and_names.txt": lines("Survey of the quarry", "X Y Z", XYZ),
    "latin_comment.txt": lines("# H\xf6he in m", XYZ).encode("latin-1"),
    "utf16.txt": lines(XYZ).encode("utf-16"),
    "tabs.txt": lines("X\tY\tZ", [row.replace(" ", "\t") for row in XYZ]),
    "bars.txt": lines([row.replace(" ", "|") for row in XYZ]),
    "tab_and_blank.txt": lines(rows("%.3f %.3f\t%.3f", POINTS)),
    "names_of_two_words.txt": lines("# GPS time  X  Y  Z", rows("%d %.3f %.3f %.3f", TIMES, POINTS)),
    "names_repeated.txt": lines("X Y Z", XYZ[:9], "X Y Z", XYZ[9:]),
    "old_end.txt": lines(XYZ) + "\x1a",
    "labels_without_names.txt": lines(["P1 " + row for row in XYZ]),
    "letters.csv": lines("E,N,H", CSV),
    "percent_names.txt": lines("% x y z", XYZ),
    "semicolon_comment.txt": lines(";; a comment", XYZ),
    "time_in_comment.txt": lines("# time easting northing height", rows("%d %.3f %.3f %.3f", TIMES, POINTS)),
    "time_two_comments.txt": lines("# TIME X Y Z", "# more", rows("%d %.3f %.3f %.3f", TIMES, POINTS)),
    "decimal_commas.txt": lines([row.replace(";", " ") for row in DECIMAL]),
    "decimal_commas_tabs.txt": lines([row.replace(";", "\t") for row in DECIMAL]),
    "id_first.txt": lines("id x y z r g b", rows("%d %.3f %.3f %.3f %d %d %d", TIMES, POINTS, RGB)),
    "plain.csv": lines("x,y,z", CSV),
    "upper.csv": lines("X,Y,Z", CSV),
    "bom.csv": ("\ufeff" + lines("x,y,z", CSV)).encode(),
    "blank_behind_names.csv": lines("X,Y,Z", "", CSV),
    "comma_and_blank.csv": lines("X, Y, Z", [row.replace(",", ", ") for row in CSV]),
    "quoted_names.csv": lines('"X","Y","Z"', CSV),
    "quoted.csv": lines('"X","Y","Z"', ['"' + row.replace(",", '","') + '"' for row in CSV]),
    "quoted_decimal_commas.csv": lines('"X","Y","Z"', ['"' + row.replace(";", '","') + '"' for row in DECIMAL]),
    "semicolons.csv": lines("X;Y;Z", SEMI),
    "decimal_commas.csv": lines("X;Y;Z", DECIMAL),
    "decimal_commas_no_names.csv": lines(DECIMAL),
    "delimiter_at_end.csv": lines("x,y,z", [row + "," for row in CSV]),
    "delimiter_at_end_names.csv": lines("x,y,z,", [row + "," for row in CSV]),
    "units.csv": lines("X [m],Y [m],Z [m]", CSV),
    "northing_first.csv": lines("Northing,Easting,Elevation", rows("%.3f,%.3f,%.3f", POINTS[:, [1, 0, 2]])),
    "german.csv": lines("Rechtswert;Hochwert;H\xf6he", SEMI).encode("latin-1"),
    "paraview.csv": lines('"Points:0","Points:1","Points:2"', CSV),
    "robot.csv": lines("stamp,position.x,position.y,position.z", rows("%d,%.3f,%.3f,%.3f", TIMES, POINTS)),
    "index_without_name.csv": lines(",x,y,z", rows("%d,%.3f,%.3f,%.3f", TIMES, POINTS)),
    "label_first.csv": lines("label,x,y,z", ["wall," + row for row in CSV]),
    "label_with_comma.csv": lines("x,y,z,label", [row + ',"wall, north"' for row in CSV]),
    "missing_values.csv": lines("x,y,z,i", [row + (",5" if k % 2 else ",") for k, row in enumerate(CSV)]),
    "count.asc": lines("//X Y Z", str(COUNT), XYZ),
    "count.pts": lines(str(COUNT), XYZ),
    "two_scans.pts": lines("15", XYZ[:15], "25", XYZ[15:]),
}
"""No colours; names other than of points are kept as attributes."""

COLOURED: dict[str, str | bytes] = {
    "cloudcompare.asc": lines("//X Y Z R G B", rows("%.3f %.3f %.3f %d %d %d", POINTS, RGB)),
    "cloudcompare_floats.asc": lines("//X,Y,Z,Rf,Gf,Bf", rows("%.3f,%.3f,%.3f,%.5f,%.5f,%.5f", POINTS, RGB / 255)),
    "quoted_names.csv": lines('"X","Y","Z","Red","Green","Blue"', rows("%.3f,%.3f,%.3f,%d,%d,%d", POINTS, RGB)),
    "colours_first.csv": lines('"RGB:0","RGB:1","RGB:2",x,y,z', rows("%d,%d,%d,%.3f,%.3f,%.3f", RGB, POINTS)),
    "no_names.xyz": lines(rows("%.3f %.3f %.3f %d %d %d", POINTS, RGB)),
    "unit.xyzrgb": lines(rows("%.3f %.3f %.3f %.5f %.5f %.5f", POINTS, RGB / 255)),
    "intensity.pts": lines(str(COUNT), rows("%.3f %.3f %.3f %d %d %d %d", POINTS, TIMES - 9, RGB)),
    "vertices.obj": lines(rows("v %.3f %.3f %.3f %.5f %.5f %.5f", POINTS, RGB / 255)),
    "bytes.off": lines("COFF", f"{COUNT} 0 0", rows("%.3f %.3f %.3f %d %d %d 255", POINTS, RGB)),
    "floats.off": lines("COFF", f"# made\n{COUNT} 0 0", rows("%.3f %.3f %.3f %.5f %.5f %.5f 1", POINTS, RGB / 255)),
}

PLY_HEAD = "format {} 1.0\nelement vertex 40\nproperty double {}\nproperty double {}\nproperty double {}\n"


def ply(form: str, axes: str = "xyz", more: str = "", magic: str = "ply\n", end: str = "end_header\n") -> bytes:
    return (magic + PLY_HEAD.format(form, *axes) + more + end).encode()


FACES = "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\n"
LITTLE, BIG = POINTS.astype("<f8").tobytes(), POINTS.astype(">f8").tobytes()


def pcd(form: str, body: bytes, fields: str = "x y z", kinds: str = "F F F", sizes: str = "8 8 8") -> bytes:
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {kinds}\nWIDTH 40\nHEIGHT 1\n"
    return (head + f"VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 40\nDATA {form}\n").encode() + body


def literal_lzf(content: bytes) -> bytes:
    """Pack without compressing: runs of 32 bytes as they are."""
    packed = b"".join(bytes([len(content[k : k + 32]) - 1]) + content[k : k + 32] for k in range(0, len(content), 32))
    return struct.pack("<II", len(packed), len(content)) + packed


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def npz(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def records(names: str, kind: str = "f8") -> np.ndarray:
    out = np.zeros(COUNT, dtype=[(name, kind) for name in names])
    for k, name in enumerate(names[:3]):
        out[name] = POINTS[:, k]
    return out


def ptx(shift: float) -> str:
    """A scan whose frame is turned by a quarter and stands at (10, 20, shift)."""
    pose = ["5", "9", f"10 20 {shift}", "1 0 0", "0 1 0", "0 0 1"]
    pose += ["0 1 0 0", "-1 0 0 0", "0 0 1 0", f"10 20 {shift} 1"]
    local = (POINTS - [10, 20, shift])[:, [1, 0, 2]] * [1, -1, 1]
    return lines(pose, ["0 0 0 0.5"] * 5, rows("%.3f %.3f %.3f 0.25", local))


def stl_text() -> str:
    facets = ["facet normal 0 0 1\nouter loop"]
    for k in range(0, COUNT, 2):
        trio = [XYZ[k], XYZ[k + 1], XYZ[0]]
        facets += [*("vertex " + row for row in trio), "endloop\nendfacet\nfacet normal 0 0 1\nouter loop"]
    return lines("solid made by hand", facets[:-1], "endloop\nendfacet\nendsolid")


BINARY: dict[str, Callable[[], bytes | str]] = {
    "ascii.ply": lambda: ply("ascii") + lines(XYZ).encode(),
    "ascii_crlf.ply": lambda: (ply("ascii") + lines(XYZ).encode()).replace(b"\n", b"\r\n"),
    "ascii_mac.ply": lambda: (ply("ascii") + lines(XYZ).encode()).replace(b"\n", b"\r"),
    "no_lines.ply": lambda: ply("ascii") + " ".join(XYZ).encode(),
    "tabs_in_header.ply": lambda: ply("ascii").replace(b"property ", b"property\t") + lines(XYZ).encode(),
    "faces_of_unknown_type.ply": lambda: ply("binary_big_endian", more=FACES.replace("int", "int128")) + BIG + b"\3",
    "faces_less_than_none.ply": lambda: ply("ascii", more=FACES.replace("2", "-2", 1)) + lines(XYZ).encode(),
    "little.ply": lambda: ply("binary_little_endian") + LITTLE,
    "big.ply": lambda: ply("binary_big_endian") + BIG,
    "capitals.ply": lambda: ply("binary_little_endian", "XYZ") + LITTLE,
    "blank_behind_magic.ply": lambda: ply("binary_little_endian", magic="ply \n") + LITTLE,
    "blank_behind_end.ply": lambda: ply("binary_little_endian", end="end_header \n") + LITTLE,
    "crlf_binary.ply": lambda: ply("binary_little_endian").replace(b"\n", b"\r\n") + LITTLE,
    "no_faces.ply": lambda: ply("binary_little_endian", more=FACES.replace("2", "0", 1)) + LITTLE,
    "faces_cut.ply": lambda: ply("binary_little_endian", more=FACES) + LITTLE + b"\3" + bytes(7),
    "faces_of_a_billion.ply": lambda: ply("binary_big_endian", more=FACES.replace("2", "1000000000", 1)) + BIG,
    "faces_malformed.ply": lambda: ply("ascii", more=FACES) + lines(XYZ, "3 0 1 2 9 1 1 1", "3 0 1 2 9").encode(),
    "polygons.ply": lambda: ply("ascii", more=FACES) + lines(XYZ, "4 0 1 2 3 9", "3 0 1 2 9").encode(),
    "ascii.pcd": lambda: pcd("ascii", lines(XYZ).encode()),
    "binary.pcd": lambda: pcd("binary", LITTLE),
    "compressed.pcd": lambda: pcd("binary_compressed", literal_lzf(POINTS.T.astype("<f8").tobytes())),
    "padded.pcd": lambda: pcd(
        "binary", np.c_[POINTS, POINTS[:, 0]].astype("<f8").tobytes(), "x y z _", "F F F F", "8 8 8 8"
    ),
    "columns.npy": lambda: npy(POINTS),
    "fortran.npy": lambda: npy(np.asfortranarray(POINTS)),
    "big.npy": lambda: npy(POINTS.astype(">f8")),
    "records.npy": lambda: npy(records("xyzt")),
    "capitals.npy": lambda: npy(records("XYZ")),
    "points.npz": lambda: npz(**{"points.npy": npy(POINTS), "note.txt": b"no array", "t.npy": npy(TIMES)}),
    "records.npz": lambda: npz(**{"points.npy": npy(records("xyz"))}),
    "one.ptx": lambda: ptx(3),
    "vertices.obj": lambda: lines(["v " + row for row in XYZ], "f 1 2 3", "f -1 -2 -3"),
    "plain.off": lambda: lines("OFF", f"{COUNT} 1 0", XYZ, "3 0 1 2"),
    "counts_behind_magic.off": lambda: lines(f"OFF {COUNT} 0 0", "# a comment", XYZ),
    "text.stl": stl_text,
}
