"""KITTI-layout drives as range images: reading, projection (RangeNet++), augmentation."""

from glob import glob
from pathlib import Path

import numpy as np

FOV_UP_DEG, FOV_DOWN_DEG = 3.0, -25.0
MEANS = np.array([12.12, 10.88, 0.23, -1.04, 0.21], np.float32)
DEVIATIONS = np.array([12.32, 11.47, 6.91, 0.86, 0.16], np.float32)

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
    """A scan as an image in few bytes: ranges in 2 mm, heights in mm, remissions in hundredths, classes."""
    points, labels = read(pair)
    ranges, row, column = pixels(points, height, width)
    order = np.argsort(-ranges)
    cell = (row * width + column)[order]
    images = []
    for values, dtype in [(ranges * 500, np.uint16), (points[2] * 1000, np.int16), (points[3] * 100, np.uint8), (labels, np.uint8)]:
        image = np.zeros(height * width, dtype)
        image[cell] = np.rint(values[order])
        images.append(image.reshape(height, width))
    return images


def sector(images, columns, random):
    """Some columns of the images, from a random one on, at times mirrored."""
    width = images[0].shape[1]
    at = (random.integers(width) + np.arange(columns)) % width
    return [image[:, at[::-1] if mirrored else at] for mirrored in [random.random() < 0.5] for image in images]


# What may stand anywhere on the ground, and is rare.
LOOSE = np.isin(CLASSES, "car bicycle motorcycle truck other-vehicle person bicyclist motorcyclist trunk pole traffic-sign".split())


def mix(images, others, random):
    """Part of another scan's turn in this one, or its loose things wherever they are nearer (PolarMix, Xiao et al. 2022)."""
    columns = images[0].shape[1]
    at = random.integers(columns)
    if random.random() < 0.4:
        take = np.zeros(images[0].shape, bool)
        take[:, at : at + random.integers(columns // 2)] = True
    elif random.random() < 0.7:
        others = [np.roll(other, at, 1) for other in others]
        # Rows without a laser stay empty.
        lit = (images[0] > 0) | ((images[0] > 0).mean(1, keepdims=True) > 0.3)
        take = LOOSE[others[3]] & lit & ((images[0] == 0) | (others[0] < images[0]))
    else:
        return images
    return [np.where(take, other, image) for image, other in zip(images, others)]


def seam(images, random):
    """Where a turn ends next to where it began, what moves is cut off, or is there twice."""
    columns = images[0].shape[1]
    at, jump = random.integers(columns), random.integers(-12, 13)
    order = np.arange(columns)
    order[at:] = (order[at:] + jump) % columns
    return [image[:, order] for image in images]


def augment(images, random):
    """What differs between sensors, mounts and places, as far as it can be changed afterwards.

    A normalised image [5, H, W] (x and y are 0: the network does not look at them) and classes [H, W].
    """
    ranges, heights, remission, classes = seam(images, random) if random.random() < 0.3 else images
    shape = ranges.shape
    ranges, heights = ranges * np.float32(0.002), heights * np.float32(0.001)
    if random.random() < 0.25:
        ranges, heights, remission, classes = pass_van(ranges, heights, remission, classes, random)
    # A mount that is not quite level looks as a slope across the image.
    tilt = np.sin(np.linspace(0, np.pi, shape[1], dtype=np.float32) + random.uniform(0, 2 * np.pi))
    heights = heights + ranges * (np.float32(random.normal(0, 0.005)) * tilt)
    scale = np.float32(random.uniform(0.92, 1.08))
    moved = ranges + augment_ranges(ranges, classes, random) + shift_rays(ranges, random)
    heights = heights * (moved / np.maximum(ranges, 1))
    ranges = np.where(ranges > 0, np.maximum(moved, 0.5), 0)
    keep = ranges > 0
    if random.random() < 0.5:
        keep &= random.random(shape, np.float32) > random.choice([0.01, 0.05, 0.2])
    # Echoes at edges get lost.
    edges = np.abs(ranges[:, 1:] - ranges[:, :-1]) > 0.1 * ranges[:, 1:]
    keep[:, 1:] &= ~edges | (random.random(edges.shape, np.float32) > random.uniform(0, 0.4))
    if random.random() < 0.2:
        # Some lasers are blind.
        keep &= random.random((shape[0], 1)) > random.uniform(0, 0.2)
    image = np.zeros((5, *shape), np.float32)
    lifted = scale * heights + np.float32(random.normal(0, 0.06))
    for channel, values in [(0, scale * ranges), (3, lifted), (4, augment_remission(remission, classes, random))]:
        image[channel] = (values - MEANS[channel]) * (keep / DEVIATIONS[channel])
    return image, classes * keep


def pass_van(ranges, heights, remission, classes, random):
    """Puts the bare side of a van into a scan, an arm's length away: it fills the view, with neither wheels nor roof in it."""
    rows, columns = ranges.shape
    pitch = np.radians(FOV_UP_DEG + (FOV_DOWN_DEG - FOV_UP_DEG) * (np.arange(rows)[:, None] + 0.5) / rows)
    step = np.pi / columns  # Training images are half a turn.
    azimuth = (np.arange(columns)[None] - random.uniform(0.1, 0.9) * columns) * step
    facing = np.cos(azimuth).clip(0.02)
    away = random.uniform(1.8, 3.6)
    side = away / (np.cos(pitch) * facing)
    along, up = away * np.sin(azimuth) / facing, side * np.sin(pitch)
    length, shift = random.uniform(4, 7), random.uniform(-1, 1)
    from_nose = (0.5 + 0.5 * shift) * length - along
    top, waist = random.uniform(-0.1, 1.5), random.uniform(-0.7, -0.4)
    low = random.uniform(0.6, 1.6)  # How far the bonnet goes.
    roof = np.where(from_nose < low, waist + 0.2, waist + (top - waist) * ((from_nose - low) / 0.8).clip(0, 1))
    inside = (from_nose > 0) & (from_nose < length) & (up > random.uniform(-1.5, -1.1)) & (up < roof)
    glass = (from_nose > low + 0.3) & (from_nose < low + 1.3) & (up > waist) & (up < top - 0.2)
    # Rows without a laser, and what the own vehicle hides, stay empty.
    lit = ((ranges > 0).mean(1, keepdims=True) > 0.3) & ((ranges > 0) | (pitch > -0.2))
    seen = inside & lit & ((ranges == 0) | (side < ranges))
    paint = random.uniform(0.02, 0.6) * (0.6 + 0.4 * facing)
    gone = seen & glass & (random.random(rows)[:, None] < 0.7)
    put = lambda new, old: np.where(gone, 0, np.where(seen, new, old)).astype(old.dtype)
    label = random.choice([CLASSES.index("car"), CLASSES.index("car"), CLASSES.index("truck")])
    return put(side, ranges), put(up, heights), put(100 * paint, remission), put(label, classes)


def augment_ranges(ranges, classes, random):
    """What to add to ranges: noise that grows, lasers that measure too far or too near, leaves that let rays in, high grass."""
    shape = ranges.shape
    added = (random.uniform(0, 0.015) + random.choice([0, 0.001, 0.002]) * ranges).astype(np.float32) * normals(shape, random)
    rows = random.normal(0, random.uniform(0, 0.06), (shape[0], 1))
    chunks = random.normal(0, random.uniform(0, 0.03), (shape[0], shape[1] // 16)).repeat(16, 1)
    added[:, : chunks.shape[1]] += (rows + chunks).astype(np.float32)
    thickness = random.uniform(0, 0.3, (shape[0] // 8, shape[1] // 32)) * random.uniform(0, 1)
    depth = thickness.repeat(8, 0).repeat(32, 1).astype(np.float32) * np.abs(normals(shape, random))
    # Blades of grass stop rays before the ground, the earlier the flatter they come.
    added -= 0.15 * depth * ranges * (classes == CLASSES.index("terrain"))
    return added + depth * (classes == CLASSES.index("vegetation"))


def shift_rays(ranges, random):
    """What to add to ranges since rays do not hit the middle of their pixels.

    The encoder of a real sensor adds half steps, so that from row to row and from place to place the rays lie
    elsewhere in their pixels: walls that are seen from the side get rough, more so far away.
    """
    shape = ranges.shape
    before, after = np.roll(ranges, 1, 1), np.roll(ranges, -1, 1)
    slope = 0.5 * (after - before)
    smooth = (before > 0) & (after > 0) & (np.abs(slope) < 0.05 * ranges) & (np.abs(before + after - 2 * ranges) < 0.05 * ranges)
    reach = random.uniform(0, 0.35)
    shift = random.uniform(-reach, reach, (shape[0], shape[1] // 16)).astype(np.float32).repeat(16, 1)
    return np.where(smooth, slope * shift, 0)


def normals(shape, random):
    """Normal numbers from a table: faster than new ones."""
    return random.standard_normal(4096, np.float32)[random.integers(0, 4096, shape, np.uint16)]


def augment_remission(hundredths, classes, random):
    """Other gains, of each row and class too: no class is told by how bright it is in a simulated town.

    More noise; more echoes without a remission, or all of them.
    """
    if random.random() < 0.2:
        return np.float32(0)
    curve = (np.arange(256, dtype=np.float32) / 100) ** random.uniform(0.8, 1.25) * random.uniform(0.6, 1.5)
    gains = np.exp(random.normal(0, random.uniform(0, 0.3), (len(hundredths), 1))).astype(np.float32)
    gains = gains * np.exp(random.normal(0, random.uniform(0, 0.5), len(CLASSES))).astype(np.float32)[classes]
    seen = curve.astype(np.float32)[hundredths] * gains
    seen += np.float32(random.uniform(0, 0.02)) * normals(seen.shape, random)
    lost = random.random(seen.shape, np.float32) < random.choice([0, 0.05, 0.15])
    return np.where((hundredths > 0) & ~lost, seen.clip(0, 1), 0)
