"""Polylines in VTK's XML format for poly data (.vtp), which meshio does not write."""

from __future__ import annotations

import base64
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import BinaryIO
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

_TYPES = {"f": "Float", "i": "Int"}


@dataclass(frozen=True)
class Polylines:
    """Curves through points: line l goes through the points offsets[l] ... offsets[l + 1] - 1.

    points (P, 3); offsets (L + 1,); point_data, line_data: values (P,) or (P, 3), and (L,) or (L, 3), by name.
    """

    points: NDArray
    offsets: NDArray
    point_data: Mapping[str, NDArray] = field(default_factory=dict)
    line_data: Mapping[str, NDArray] = field(default_factory=dict)

    def segments(self) -> NDArray[np.int64]:
        """The pairs of neighbouring points, (M, 2)."""
        first = np.delete(np.arange(len(self.points)), self.offsets[1:] - 1)
        return np.stack([first, first + 1], axis=-1)


def write_vtp(file: BinaryIO, lines: Polylines) -> None:
    """Write polylines into an open file. Raises OSError where they do not fit."""
    count = len(lines.offsets) - 1
    root = ElementTree.Element(
        "VTKFile", type="PolyData", version="1.0", byte_order="LittleEndian", header_type="UInt64"
    )
    piece = ElementTree.SubElement(
        ElementTree.SubElement(root, "PolyData"),
        "Piece",
        NumberOfPoints=str(len(lines.points)),
        NumberOfLines=str(count),
        NumberOfVerts="0",
        NumberOfStrips="0",
        NumberOfPolys="0",
    )
    _section(piece, "PointData", lines.point_data)
    _section(piece, "CellData", lines.line_data)
    _section(piece, "Points", {"Points": lines.points})
    connectivity = np.arange(len(lines.points), dtype=np.int64)
    _section(piece, "Lines", {"connectivity": connectivity, "offsets": lines.offsets[1:].astype(np.int64)})
    ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _section(piece: ElementTree.Element, name: str, arrays: Mapping[str, NDArray]) -> None:
    section = ElementTree.SubElement(piece, name)
    for title, values in arrays.items():
        words = {"NumberOfComponents": "3"} if values.ndim == 2 else {}
        kind = f"{_TYPES[values.dtype.kind]}{8 * values.dtype.itemsize}"
        array = ElementTree.SubElement(section, "DataArray", type=kind, Name=title, format="binary", **words)
        data = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
        array.text = base64.b64encode(struct.pack("<Q", len(data)) + data).decode()
