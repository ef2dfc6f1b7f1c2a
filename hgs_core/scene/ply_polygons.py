"""Binary PLY files whose faces have different numbers of corners, which trimesh cannot read.

Format: Turk, "The PLY Polygon File Format", 1994. Polygons are cut into fans: right for convex ones, as
triangles, quads and those that scanners' tools write are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Int64
from numpy import ndarray

from hgs_core.errors import SceneError

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float": "f4",
    "double": "f8",
    "float32": "f4",
    "float64": "f8",
}
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_ENDIANNESS: dict[str, Literal["little", "big"]] = {"<": "little", ">": "big"}


@dataclass(kw_only=True, eq=False)
class _Element:
    name: str
    count: int
    scalars: list[tuple[str, str]] = field(default_factory=list)
    """Name and type of each, in order; of a face, those before its list."""
    lists: list[tuple[str, str]] = field(default_factory=list)
    """Types of length and items."""
    after: list[tuple[str, str]] = field(default_factory=list)
    """Scalars behind the list."""


def read_polygons(path: Path) -> trimesh.Trimesh | None:
    """Triangles of a binary PLY of mixed polygons, with the colours of its vertices; None for any other PLY.

    Raises `SceneError` where such a file ends too early or a face names a vertex that is not there.
    """
    content = path.read_bytes()
    header_end = content.find(b"end_header\n")
    if header_end < 0:
        return None
    order, elements = _header(content[:header_end].decode("ascii", errors="replace"))
    body = content[header_end + len(b"end_header\n") :]
    if order is None or [element.name for element in elements[:2]] != ["vertex", "face"]:
        return None
    vertex, face = elements[:2]
    names = {name for name, _ in vertex.scalars}
    if vertex.lists or len(face.lists) != 1 or not face.count or not {"x", "y", "z"} <= names:
        return None
    vertices = np.dtype([(name, order + kind) for name, kind in vertex.scalars])
    faces = body[vertices.itemsize * vertex.count :]
    if len(body) < vertices.itemsize * vertex.count or _of_one_length(faces, face, order):
        return None
    table = np.frombuffer(body, dtype=vertices, count=vertex.count)
    triangles = _triangles(faces, face, order, path)
    if len(triangles) and not (triangles.min() >= 0 and triangles.max() < vertex.count):
        raise SceneError(f"{path} has faces with vertices outside 0..{vertex.count - 1}: export it again")
    rgb = [table[name] for name in ("red", "green", "blue") if name in names]
    return trimesh.Trimesh(
        vertices=np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float64),
        faces=triangles,
        vertex_colors=np.stack(rgb, axis=1) if len(rgb) == 3 else None,
        process=False,
    )


def _header(text: str) -> tuple[str | None, list[_Element]]:
    """Byte order (None for a text file or unknown types) and elements."""
    order: str | None = None
    elements: list[_Element] = []
    for words in (line.split() for line in text.splitlines()):
        if words[:1] == ["format"]:
            order = _BYTE_ORDERS.get(words[1])
        elif words[:1] == ["element"]:
            elements.append(_Element(name=words[1], count=int(words[2])))
        elif words[:1] == ["property"] and elements:
            kinds = words[2:4] if words[1] == "list" else words[1:2]
            if any(kind not in _TYPES for kind in kinds):
                return None, []
            last = elements[-1]
            if words[1] == "list":
                last.lists.append((_TYPES[kinds[0]], _TYPES[kinds[1]]))
            else:
                (last.after if last.lists else last.scalars).append((words[-1], _TYPES[kinds[0]]))
    return order, elements


def _of_one_length(faces: bytes, face: _Element, order: str) -> bool:
    """Whether all faces have as many corners as the first: then trimesh reads them, at once."""
    (length, item), before = face.lists[0], _size(face.scalars)
    if len(faces) < before + np.dtype(length).itemsize:
        return True
    first = int(np.frombuffer(faces, dtype=order + length, count=1, offset=before)[0])
    size = before + np.dtype(length).itemsize + first * np.dtype(item).itemsize + _size(face.after)
    if len(faces) < size * face.count:
        return False
    record = np.dtype({"names": ["n"], "formats": [order + length], "offsets": [before], "itemsize": size})
    return bool(np.all(np.frombuffer(faces, dtype=record, count=face.count)["n"] == first))


def _triangles(faces: bytes, face: _Element, order: str, path: Path) -> Int64[ndarray, "n 3"]:
    length, item = (np.dtype(order + kind) for kind in face.lists[0])
    before, after = _size(face.scalars), _size(face.after)
    corners = np.empty(face.count, dtype=np.int64)
    begins = np.empty(face.count, dtype=np.int64)
    at = 0
    for index in range(face.count):
        at += before
        if at + length.itemsize > len(faces):
            raise SceneError(f"{path} ends within face {index} of {face.count}: copy or download it again")
        begins[index] = at + length.itemsize
        corners[index] = n = int.from_bytes(faces[at : at + length.itemsize], _ENDIANNESS[order])
        at += length.itemsize + n * item.itemsize + after
    if at > len(faces):
        raise SceneError(f"{path} ends within its last face: copy or download it again")
    parts = []
    for n in np.unique(corners[corners >= 3]):
        offsets = begins[corners == n][:, None] + np.arange(n * item.itemsize)
        polygons = np.frombuffer(faces, np.uint8)[offsets].view(item).astype(np.int64)
        fan = np.stack([np.zeros(n - 2, np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
        parts.append(polygons[:, fan].reshape(-1, 3))
    return np.concatenate(parts) if parts else np.zeros((0, 3), np.int64)


def _size(scalars: list[tuple[str, str]]) -> int:
    return sum(np.dtype(kind).itemsize for _, kind in scalars)
