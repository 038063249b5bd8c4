"""Pictures for notebooks, as HTML without any library: bars, heat maps and a drawing of a mesh."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Sequence
from html import escape

import numpy as np
import numpy.typing as npt

SHOWN = 12
"""Number of images of a heat map."""
SIDE = 200
"""Width and height of the drawing of a mesh, pixels."""
_SAMPLES = 60_000
"""Number of points of a mesh that are drawn."""


def bars(rows: Sequence[tuple[str, float]], title: str) -> str:
    """Names with their probabilities as bars."""
    lines = "".join(
        f"<tr><td>{escape(name)}</td><td><svg width='120' height='10'>"
        f"<rect width='{120 * share:.1f}' height='10' fill='#3b6fb6'/></svg></td>"
        f"<td>{share:.1%}</td></tr>"
        for name, share in rows
    )
    return f"<table><caption>{escape(title)}</caption>{lines}</table>"


def heat(images: npt.NDArray[np.float64], title: str) -> str:
    """The first images (n × rows × cols, Pa) as squares, one a taxel, on a common scale."""
    largest = float(np.nanmax(images, initial=0.0)) or 1.0
    drawn = "".join(_image(image, largest) for image in images[:SHOWN])
    more = f" (the first {SHOWN})" if len(images) > SHOWN else ""
    return f"<div>{escape(title)}{more}; 0 to {largest:.0f} Pa<br>{drawn}</div>"


def _image(image: npt.NDArray[np.float64], largest: float) -> str:
    rows, cols = image.shape
    side = max(2, min(10, 80 // max(rows, cols)))
    squares = "".join(
        f"<rect x='{side * col}' y='{side * row}' width='{side}' height='{side}' "
        f"fill='{_shade(image[row, col] / largest)}'/>"
        for row in range(rows)
        for col in range(cols)
    )
    return f"<svg width='{side * cols + 6}' height='{side * rows + 6}'>{squares}</svg>"


def _shade(share: float) -> str:
    if share != share:
        return "#d33"
    light = round(245 - 215 * min(max(share, 0.0), 1.0))
    return f"rgb({light},{light},{min(255, light + 20)})"


def mesh(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64], title: str) -> str:
    """A drawing of a mesh from above the corner, with its size."""
    return f"<div>{_drawing(vertices, faces)}<br>{escape(title)}</div>"


def _drawing(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]) -> str:
    """Points of the surface in order of depth, shaded by their normals, as a PNG."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    areas[areas == 0] = np.finfo(float).tiny
    random = np.random.default_rng(1)
    chosen = random.choice(len(faces), _SAMPLES, p=areas / areas.sum())
    u, v = np.sort(random.random((2, _SAMPLES)), axis=0)
    weights = np.stack([u, v - u, 1 - v], axis=1)
    points = np.einsum("nk,nkj->nj", weights, corners[chosen])
    look = np.array([-0.5, 0.7, -0.5]) / np.linalg.norm([0.5, 0.7, 0.5])
    right = np.cross(look, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, look)
    middle = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
    scale = 0.47 * SIDE / max(float(np.linalg.norm(vertices - middle, axis=1).max()), 1e-12)
    placed = (points - middle) * scale
    x = np.clip(SIDE / 2 + placed @ right, 0, SIDE - 1).astype(int)
    y = np.clip(SIDE / 2 - placed @ up, 0, SIDE - 1).astype(int)
    shade = 60 + 170 * np.abs((across / areas[:, None])[chosen] @ look)
    pixels = np.full((SIDE, SIDE), 255, dtype=np.uint8)
    # The farthest first, so that the nearest stays.
    order = np.argsort(-(placed @ look))
    pixels[y[order], x[order]] = shade[order].astype(np.uint8)
    return f"<img alt='drawing' src='data:image/png;base64,{_png(pixels)}'>"


def _png(pixels: npt.NDArray[np.uint8]) -> str:
    height, width = pixels.shape
    rows = b"".join(b"\x00" + row.tobytes() for row in pixels)

    def chunk(kind: bytes, content: bytes) -> bytes:
        checked = kind + content
        return struct.pack(">I", len(content)) + checked + struct.pack(">I", zlib.crc32(checked))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    image = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    image += chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return base64.b64encode(image).decode()
