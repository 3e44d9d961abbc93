"""KITTI-layout drives as range images: reading, projection (RangeNet++)."""

from glob import glob
from pathlib import Path

import numpy as np

FOV_UP_DEG, FOV_DOWN_DEG = 3.0, -25.0
MEANS = np.array([12.12, 10.88, 0.23, -1.04, 0.21], np.float32)
DEVIATIONS = np.array([12.32, 11.47, 6.91, 0.86, 0.16], np.float32)
# Steps of compact images [m]: ranges go up to 81.9 m; KITTI's files end at 80.
RANGE_M, HEIGHT_M = 0.0025, 0.001

CLASSES = (
    "unlabeled car bicycle motorcycle truck other-vehicle person bicyclist motorcyclist road parking sidewalk "
    "other-ground building fence vegetation trunk terrain pole traffic-sign"
).split()
# SemanticKITTI's raw ids of each class, its own first; whatever is not here is unlabeled.
RAW_IDS = [
    [0, 1, 52, 99], [10, 252], [11], [15], [18, 258], [20, 13, 16, 256, 257, 259], [30, 254], [31, 253], [32, 255],
    [40, 60], [44], [48], [49], [50], [51], [70], [71], [72], [80], [81],
]
GROUPS = {
    "ground": [9, 10, 11, 12, 17],
    "building, fence": [13, 14],
    "vegetation": [15],
    "trunk, pole, sign": [16, 18, 19],
    "vehicle": [1, 4, 5],
    "person, cyclist": [6, 7, 8],
}

CLASS_OF_RAW = np.zeros(1 << 16, np.uint8)
for _index, _ids in enumerate(RAW_IDS):
    CLASS_OF_RAW[_ids] = _index


def scans(folders, every=1):
    """The (points, labels) files of some `sequences/NN` folders, which may be patterns."""
    pairs = []
    for folder in map(Path, [path for pattern in folders for path in sorted(glob(pattern))]):
        points = sorted((folder / "velodyne").glob("*.bin"))[::every]
        pairs += [(p, folder / "labels" / f"{p.stem}.label") for p in points]
    return pairs


def is_whole(pair):
    """Whether both files are there, with as many labels as points: a drive may be being written."""
    points, labels = pair
    return labels.exists() and points.stat().st_size == 4 * labels.stat().st_size > 0


def read(pair):
    """Points [4, N] (x, y, z in metres, remission) and classes [N]."""
    points = np.ascontiguousarray(np.fromfile(pair[0], np.float32).reshape(-1, 4).T)
    labels = CLASS_OF_RAW[np.fromfile(pair[1], np.uint32) & 0xFFFF]
    assert points.shape[1] == len(labels), f"{pair[1]}: {len(labels)} labels for {points.shape[1]} points"
    return points, labels


def pixels(points, height, width):
    """Range, row and column of each point."""
    x, y, z = points[:3]
    ranges = np.sqrt(x * x + y * y + z * z)
    pitch = np.arcsin(np.clip(z / np.maximum(ranges, 1e-6), -1, 1))
    column = np.floor(0.5 * (1 - np.arctan2(y, x) / np.pi) * width).astype(np.int32).clip(0, width - 1)
    share = (np.degrees(pitch) - FOV_DOWN_DEG) / (FOV_UP_DEG - FOV_DOWN_DEG)
    row = np.floor((1 - share) * height).astype(np.int32).clip(0, height - 1)
    return ranges, row, column


def project(points, labels, height, width):
    """Normalised image [5, H, W] and classes [H, W] (0 where empty); the nearest point wins a pixel."""
    ranges, row, column = pixels(points, height, width)
    # Steps of 4 mm sort five times faster than floats.
    order = np.argsort(-np.minimum(ranges * 250, 32767).astype(np.int16), kind="stable")
    cell = (row * width + column)[order]
    image = np.zeros((5, height * width), np.float32)
    for channel, values in enumerate([ranges, *points]):
        image[channel, cell] = ((values - MEANS[channel]) / DEVIATIONS[channel])[order]
    classes = np.zeros(height * width, np.uint8)
    classes[cell] = labels[order]
    return image.reshape(5, height, width), classes.reshape(height, width)


def compact(pair, height, width):
    """A scan as images [H, W] in few bytes: ranges and heights in steps, remissions in hundredths, classes."""
    points, labels = read(pair)
    ranges, row, column = pixels(points, height, width)
    order = np.argsort(-ranges)
    cell = (row * width + column)[order]
    images = []
    for values, dtype in [
        (ranges / RANGE_M, np.int16), (points[2] / HEIGHT_M, np.int16), (points[3] * 100, np.uint8), (labels, np.uint8)
    ]:
        image = np.zeros(height * width, dtype)
        most = np.iinfo(dtype)
        image[cell] = np.rint(values[order]).clip(most.min, most.max)
        images.append(image.reshape(height, width))
    return images
