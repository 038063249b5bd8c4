"""Point-pair features and ICP of OpenCV contrib on the touches of `palpate experiment ppf-peer`.

`palpate experiment ppf-peer` writes the touches to a folder and runs this script on it:

    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install opencv-contrib-python-headless
    palpate experiment ppf-peer --python /tmp/peers/bin/python

Every object is a model of its training touches (point and normal). A scene is the first few
test touches. Each model proposes poses by PPF3DDetector; the best five are refined by ICP, the
scene onto the model (the other way round a model of a thousand points is drawn to a handful). The
object is the one whose pose explains the most touches (2 mm, 25 degrees), then the one with the
least mean distance: the module itself compares no models. Training is not timed (it takes
minutes: the module's hash table is slow to fill). Naming takes one thread.
"""

import sys
import time
from multiprocessing.pool import ThreadPool

MODULE_MISSING = 3

try:
    import cv2
    import numpy as np

    cv2.ppf_match_3d
except (ImportError, AttributeError):
    print("cv2.ppf_match_3d is missing: pip install opencv-contrib-python-headless", file=sys.stderr)
    sys.exit(MODULE_MISSING)

POSES_REFINED = 5
# Touches nearer than this share of the scene's extent are merged. The module walks a grid of
# such cells; with a hundredth of the extent it would visit a billion of them.
SCENE_STEP = 0.03
REACH_MM = 2.0
FACING = np.cos(np.radians(25.0))


def trained(points):
    """A detector and the model itself, from touches (n, 6) in millimetres."""
    detector = cv2.ppf_match_3d_PPF3DDetector(0.05, 0.05, 30)
    detector.trainModel(points)
    return detector, points


def explained(scene, model, pose):
    """Number of touches on the model at a pose, and their mean distance (capped)."""
    rotation, shift = pose[:3, :3], pose[:3, 3]
    points = (scene[:, :3] - shift) @ rotation
    normals = scene[:, 3:] @ rotation
    squares = ((points[:, None, :] - model[None, :, :3]) ** 2).sum(axis=2)
    nearest = squares.argmin(axis=1)
    # Across the surface: along it the nearest training touch may be farther away.
    off = points - model[nearest, :3]
    across = np.abs((off * model[nearest, 3:]).sum(axis=1))
    near = squares.min(axis=1) < (3.0 * REACH_MM) ** 2
    facing = (normals * model[nearest, 3:]).sum(axis=1) > FACING
    fits = near & facing & (across < REACH_MM)
    distance = np.where(fits, across, REACH_MM)
    return int(fits.sum()), float(distance.mean())


def candidates(detector, model, scene, icp):
    """The poses (scene from model) proposed by the detector, raw and refined."""
    try:
        found = detector.match(scene, 1.0, SCENE_STEP)
    except cv2.error:
        return
    for proposal in found[:POSES_REFINED]:
        pose = np.asarray(proposal.pose)
        yield pose
        start = cv2.ppf_match_3d_Pose3D()
        start.updatePose(np.linalg.inv(pose))
        try:
            _, refined = icp.registerModelToScene(scene, model, [start])
        except cv2.error:
            continue
        inverse = np.asarray(refined[0].pose)
        if np.isfinite(inverse).all() and abs(np.linalg.det(inverse[:3, :3]) - 1.0) < 1e-3:
            yield np.linalg.inv(inverse)


def name(models, scene, icp):
    """The index of the object that explains a scene best, and its pose."""
    best = (0, -np.inf, 0, np.eye(4))
    for index, (detector, model) in enumerate(models):
        for pose in candidates(detector, model, scene, icp):
            fits, distance = explained(scene, model, pose)
            if (fits, -distance) > best[:2]:
                best = (fits, -distance, index, pose)
    return best[2], best[3]


def quaternion(rotation):
    """x, y, z, w of a rotation matrix."""
    w = 0.5 * np.sqrt(max(0.0, 1.0 + np.trace(rotation)))
    if w > 1e-3:
        axis = rotation - rotation.T
        return axis[2, 1] / (4 * w), axis[0, 2] / (4 * w), axis[1, 0] / (4 * w), w
    # A half turn: the axis is the eigenvector of 1.
    values, vectors = np.linalg.eigh(0.5 * (rotation + rotation.T))
    return (*vectors[:, values.argmax()], 0.0)


def main():
    folder, counts = sys.argv[1], [int(count) for count in sys.argv[2:]]
    cv2.setNumThreads(1)
    models = np.loadtxt(f"{folder}/models.csv", delimiter=",", dtype=np.float32)
    scenes = np.loadtxt(f"{folder}/scenes.csv", delimiter=",", dtype=np.float32)
    objects = sorted(set(models[:, 0].astype(int)))
    touches = [np.ascontiguousarray(models[models[:, 0] == at, 1:]) for at in objects]
    with ThreadPool() as pool:
        known = pool.map(trained, touches)
    icp = cv2.ppf_match_3d_ICP(50, 0.005, 2.5, 1)
    lines = []
    for key in sorted({(int(row[0]), int(row[1])) for row in scenes[:, :2]}):
        own = scenes[(scenes[:, 0] == key[0]) & (scenes[:, 1] == key[1]), 2:]
        for count in counts:
            scene = np.ascontiguousarray(own[:count])
            begun = time.perf_counter()
            named, pose = name(known, scene, icp)
            milliseconds = 1e3 * (time.perf_counter() - begun)
            numbers = (*pose[:3, 3], *quaternion(pose[:3, :3]))
            answer = [*key, count, objects[named], f"{milliseconds:.3f}"]
            lines.append(",".join(map(str, answer + [f"{number:.6f}" for number in numbers])))
    with open(f"{folder}/named.csv", "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
