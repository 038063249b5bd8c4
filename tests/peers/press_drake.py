"""Drake's hydroelastic contact as the physics of two worlds of `palpate experiment other-worlds`.

`palpate experiment other-worlds` writes meshes and sensor poses to a folder and runs this script
on it:

    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install drake==1.51.1 pyyaml numpy
    palpate experiment other-worlds --python /tmp/peers/bin/python
    /tmp/peers/bin/python tests/peers/press_drake.py --check

The sensor's covering is a compliant box, the object a rigid mesh that need not be convex. Drake
computes the surface of contact and the pressure on it. Here its polygons are cut into small
triangles, and their forces along the sensor's axis are summed over the cells of the covering.
Spread, gains, noise and converter are the experiment's.

The folder holds `covering.csv` (thickness in m, pressure per depth in Pa/m, largest depth of an
object in m, rows and columns of cells, side of a cell in m), `OBJECT.off` in metres for each object (0, 1, ...), and `poses.csv`
(object, then `object_from_sensor` as metres and a quaternion x, y, z, w). The script adds
`pressures.csv`: the mean pressure (Pa) on each cell, row-major, a line for each pose in order.

With `--module` the script only tells whether Drake is there; its exit code is 3 when it is not.
With `--check` it presses a sphere and compares the image with that of the experiment's simulator.
"""

import sys
import time
from functools import lru_cache
from multiprocessing import Pool

MODULE_MISSING = 3

try:
    import numpy as np
    from pydrake.common import MemoryFile
    from pydrake.common.eigen_geometry import Quaternion
    from pydrake.geometry import (
        AddCompliantHydroelasticProperties,
        AddRigidHydroelasticProperties,
        Box,
        FramePoseVector,
        GeometryFrame,
        GeometryInstance,
        HydroelasticContactRepresentation,
        InMemoryMesh,
        Mesh,
        ProximityProperties,
        SceneGraph,
    )
    from pydrake.math import RigidTransform
except ImportError as error:
    print(f"{error}: pip install drake==1.51.1 pyyaml numpy", file=sys.stderr)
    sys.exit(MODULE_MISSING)

PROCESSES = 2
# Poses of one object that a process presses at a time.
CHUNK = 20
# Small triangles along the side of a cell.
CUTS_PER_CELL = 6


class Covering:
    """The compliant covering, and the grid of cells on its free surface (z = 0, objects above)."""

    def __init__(self, thickness, pressure_per_depth, reach, rows, cols, cell):
        self.thickness = thickness
        self.pressure_per_depth = pressure_per_depth
        self.reach = max(2 * thickness, reach)
        self.rows, self.cols, self.cell = int(rows), int(cols), cell

    def geometry(self):
        """A box whose front face is the free surface.

        Pressure grows from every face of a box to its middle. Of a box that is twice as thick as
        an object may be deep, and wider by this depth on each side, it grows from the front face
        alone over all cells. Beside the array objects may be deeper than the covering is thick:
        in a thinner box they would not be felt at all.
        """
        reach = self.reach
        width, height = self.cols * self.cell, self.rows * self.cell
        box = Box(width + 2 * reach, height + 2 * reach, 2 * reach)
        properties = ProximityProperties()
        modulus = self.pressure_per_depth * reach
        AddCompliantHydroelasticProperties(10 * reach, modulus, properties)
        instance = GeometryInstance(RigidTransform([0, 0, -reach]), box, "covering")
        instance.set_proximity_properties(properties)
        return instance


class Press:
    """A scene of one object in front of the covering; the world frame is the sensor's."""

    def __init__(self, covering, vertices, triangles):
        self.covering = covering
        self.scene = SceneGraph()
        self.source = self.scene.RegisterSource("press")
        self.scene.RegisterAnchoredGeometry(self.source, covering.geometry())
        self.frame = self.scene.RegisterFrame(self.source, GeometryFrame("object"))
        lines = ["v %r %r %r" % tuple(v) for v in vertices.tolist()]
        lines += ["f %d %d %d" % tuple(t) for t in (triangles + 1).tolist()]
        text = "\n".join(lines) + "\n"
        mesh = Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "object")))
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(properties)
        instance = GeometryInstance(RigidTransform(), mesh, "object")
        instance.set_proximity_properties(properties)
        self.scene.RegisterGeometry(self.source, self.frame, instance)
        self.context = self.scene.CreateDefaultContext()

    def pressures(self, object_from_sensor):
        """Mean pressure on each cell (rows, cols), Pa."""
        poses = FramePoseVector()
        poses.set_value(self.frame, object_from_sensor.inverse())
        self.scene.get_source_pose_port(self.source).FixValue(self.context, poses)
        query = self.scene.get_query_output_port().Eval(self.context)
        sums = np.zeros((self.covering.rows, self.covering.cols))
        for surface in query.ComputeContactSurfaces(HydroelasticContactRepresentation.kPolygon):
            self.add(sums, surface)
        return sums / self.covering.cell**2

    def add(self, sums, surface):
        """Adds the forces (N) along the sensor's axis on a surface of contact to the cells."""
        mesh, field = surface.poly_mesh_W(), surface.poly_e_MN()
        numbers = range(mesh.num_vertices())
        points = np.array([mesh.vertex(at) for at in numbers])
        pressures = np.array([field.EvaluateAtVertex(at) for at in numbers])
        # Beyond its thickness the covering is not compressed.
        limit = self.covering.pressure_per_depth * self.covering.thickness
        corners = fans(mesh.face_data())
        corners_at, corners_press = points[corners], pressures[corners]
        sides = (corners_at - np.roll(corners_at, 1, axis=1))[:, :, :2]
        (ax, ay), (bx, by) = sides[:, 1].T, sides[:, 2].T
        areas = 0.5 * np.abs(ax * by - ay * bx)
        cut = self.covering.cell / CUTS_PER_CELL
        longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
        cuts = 2 ** np.ceil(np.log2(np.maximum(longest / cut, 1.0))).astype(int)
        for n in np.unique(cuts):
            own, weights = cuts == n, middles(int(n))
            at = np.einsum("mc,tcd->tmd", weights, corners_at[own]).reshape(-1, 3)
            press = np.einsum("mc,tc->tm", weights, corners_press[own])
            force = np.clip(press, 0.0, limit) * (areas[own] / n**2)[:, None]
            self.bin(sums, at, force.ravel())

    def bin(self, sums, at, force):
        """Adds forces at points to the cells; none has those beside the covering or behind it."""
        covering = self.covering
        col = np.floor(at[:, 0] / covering.cell + 0.5 * covering.cols).astype(int)
        row = np.floor(at[:, 1] / covering.cell + 0.5 * covering.rows).astype(int)
        inside = (col >= 0) & (col < covering.cols) & (row >= 0) & (row < covering.rows)
        inside &= at[:, 2] > -covering.reach
        cells = row[inside] * covering.cols + col[inside]
        sums += np.bincount(cells, force[inside], minlength=sums.size).reshape(sums.shape)


def fans(face_data):
    """Vertex numbers (n, 3) of the triangles into which polygons fall."""
    triangles, at = [], 0
    while at < len(face_data):
        first, *others = face_data[at + 1 : at + 1 + face_data[at]]
        triangles += [(first, a, b) for a, b in zip(others, others[1:])]
        at += 1 + face_data[at]
    return np.array(triangles, dtype=int).reshape(-1, 3)


@lru_cache(maxsize=None)
def middles(n):
    """Barycentric middles (n², 3) of the triangles into which n cuts a side divide one."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    up, down = i + j < n, i + j < n - 1
    a = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / n
    b = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / n
    return np.stack([1 - a - b, a, b], axis=1)


def read_off(path):
    """Vertices (n, 3) and triangles (m, 3) of an OFF file."""
    with open(path, encoding="ascii") as file:
        words = file.read().split()
    n_vertices, n_triangles = int(words[1]), int(words[2])
    end = 4 + 3 * n_vertices
    vertices = np.array(words[4:end], dtype=float).reshape(-1, 3)
    faces = np.array(words[end : end + 4 * n_triangles], dtype=int).reshape(-1, 4)
    return vertices, faces[:, 1:]


def pose(numbers):
    """A rigid transform of metres and a quaternion x, y, z, w."""
    x, y, z, w = np.array(numbers[3:]) / np.linalg.norm(numbers[3:])
    return RigidTransform(Quaternion(w, x, y, z), numbers[:3])


@lru_cache(maxsize=1)
def scene(folder, number):
    """The scene of an object; a process keeps the last one."""
    covering = Covering(*np.loadtxt(f"{folder}/covering.csv", delimiter=","))
    return Press(covering, *read_off(f"{folder}/{number}.off"))


def press_all(chunk):
    """The lines of a chunk: folder, object, poses."""
    folder, number, poses = chunk
    press = scene(folder, number)
    images = [press.pressures(pose(numbers)) for numbers in poses]
    return [",".join(f"{value:.6g}" for value in image.ravel()) for image in images]


def press_folder(folder):
    """Presses every pose of a folder."""
    rows = np.loadtxt(f"{folder}/poses.csv", delimiter=",", ndmin=2)
    chunks = []
    for row in rows.tolist():
        number, numbers = int(row[0]), row[1:]
        if chunks and chunks[-1][1] == number and len(chunks[-1][2]) < CHUNK:
            chunks[-1][2].append(numbers)
        else:
            chunks.append((folder, number, [numbers]))
    with Pool(PROCESSES) as pool:
        lines = [line for some in pool.imap(press_all, chunks) for line in some]
    with open(f"{folder}/pressures.csv", "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


# Images (Pa) of the experiment's simulator (a test in its `other_worlds/drake.rs` compares them):
# a sphere of 20 mm at x = 4 mm and y = -2 mm, 1 mm deep, under the 6 x 6 sensor of the dissertation
# (2.54 mm of covering, 20 kPa at full indentation, a spread of 3.482 mm). The covering ends with
# the array and loses what would spread beyond, or goes on.
ENDS = [
    [366.7, 839.2, 1504.5, 2127.1, 2374.4, 2083.0],
    [468.0, 1069.4, 1915.3, 2706.3, 3020.2, 2649.2],
    [475.6, 1090.4, 1959.7, 2777.6, 3107.8, 2731.3],
    [386.5, 894.1, 1620.4, 2313.8, 2604.0, 2298.3],
    [251.0, 588.8, 1081.1, 1561.1, 1772.6, 1574.4],
    [129.4, 309.2, 577.3, 845.5, 970.5, 868.8],
]
BEYOND = [
    [392.2, 917.0, 1701.1, 2540.5, 3093.3, 3095.7],
    [486.1, 1128.5, 2080.0, 3090.7, 3752.9, 3755.8],
    [486.1, 1128.4, 2079.8, 3090.4, 3752.6, 3755.4],
    [391.9, 916.2, 1699.7, 2538.3, 3090.7, 3093.0],
    [253.6, 600.8, 1127.9, 1699.9, 2080.2, 2081.8],
    [130.7, 315.3, 601.2, 916.9, 1129.4, 1130.2],
]
# Largest deviation as a share of the image's maximum. The sphere of the check is faceted, which
# alone costs half a percent.
TOLERANCE = 0.02


def sphere(radius, n):
    """Vertices and triangles of a sphere with n rings, wound outward."""
    polar, around = np.arange(1, n) * np.pi / n, np.arange(2 * n) * np.pi / n
    theta, phi = (angle.ravel() for angle in np.meshgrid(polar, around, indexing="ij"))
    ring = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    vertices = radius * np.vstack([[0, 0, 1], np.stack(ring, axis=1), [0, 0, -1]])
    m, last = 2 * n, len(vertices) - 1
    at, after = np.arange(m), (np.arange(m) + 1) % m
    top = np.stack([np.zeros(m, dtype=int), 1 + at, 1 + after], axis=1)
    bottom = np.stack([np.full(m, last), last - m + after, last - m + at], axis=1)
    triangles = [top, bottom]
    for ring in range(n - 2):
        a, b = 1 + ring * m + at, 1 + ring * m + after
        triangles += [np.stack([a, a + m, b], axis=1), np.stack([b, a + m, b + m], axis=1)]
    return vertices, np.concatenate(triangles)


def spread(pressures, cell, is_normalised):
    """The image of 6 x 6 taxels of 1.8 mm at 2 mm under pressures on the cells around them.

    The covering ends with the cells: either an even press reads the same in every taxel, or what
    would spread beyond is lost.
    """
    sigma, n = 3.48238e-3, len(pressures)
    points = (np.arange(6) - 2.5)[:, None] * 2e-3 + (np.arange(8) - 3.5) * 1.8e-3 / 8

    def felt(cells):
        away = (np.arange(cells) - (cells - 1) / 2) * cell - points[:, :, None]
        return np.exp(-0.5 * (away / sigma) ** 2).sum(axis=1)

    weights = felt(n)
    whole = weights if is_normalised else felt(n + 2 * int(np.ceil(6 * sigma / cell)))
    weights = weights / whole.sum(axis=1, keepdims=True)
    return weights @ pressures @ weights.T


def check():
    """Compares presses of a sphere with the images of the experiment's simulator."""
    radius, depth, thickness, worst = 20e-3, 1e-3, 2.54e-3, 0.0
    at = RigidTransform([-4e-3, 2e-3, depth - radius])
    for name, cells, expected in [("ends", 12, ENDS), ("beyond", 32, BEYOND)]:
        covering = Covering(thickness, 20e3 / thickness, 10e-3, cells, cells, 1e-3)
        press = Press(covering, *sphere(radius, 180))
        begun = time.perf_counter()
        pressures = press.pressures(at)
        seconds = time.perf_counter() - begun
        image = spread(pressures, 1e-3, name == "beyond")
        off = np.abs(image - expected).max() / np.max(expected)
        print(f"{name}: off by {100 * off:.2f} % of the maximum, {seconds:.3f} s")
        worst = max(worst, off)
    if worst > TOLERANCE:
        sys.exit(f"expected at most {100 * TOLERANCE:.0f} %")


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: press_drake.py FOLDER | --check | --module")
    if sys.argv[1] == "--check":
        check()
    elif sys.argv[1] != "--module":
        press_folder(sys.argv[1])


if __name__ == "__main__":
    main()
