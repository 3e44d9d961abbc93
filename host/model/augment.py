"""Random images for training from scans: parts of turns, mixed, and changed as sensors, mounts and places differ.

Everything here works on a batch at once and on any device. Images are [B, H, W]: ranges and heights in metres, remissions in
0 to 1, classes.
"""

import math

import torch
from torch.nn import functional as F

from data import CLASSES, DEVIATIONS, FOV_DOWN_DEG, FOV_UP_DEG, HEIGHT_M, MEANS, RANGE_M

# What may stand anywhere on the ground, and is rare.
LOOSE = "car bicycle motorcycle truck other-vehicle person bicyclist motorcyclist trunk pole traffic-sign".split()


class Draw:
    """Random numbers of a seed on a device."""

    def __init__(self, device, seed):
        self.generator = torch.Generator(device).manual_seed(seed)
        self.device = device

    def uniform(self, low, high, shape):
        return low + (high - low) * torch.rand(shape, generator=self.generator, device=self.device)

    def normal(self, shape):
        return torch.randn(shape, generator=self.generator, device=self.device)

    def below(self, end, shape):
        return torch.randint(end, shape, generator=self.generator, device=self.device)

    def chance(self, probability, shape):
        return self.uniform(0, 1, shape) < probability

    def pick(self, values, shape):
        return torch.tensor(values, device=self.device)[self.below(len(values), shape)]


def batch(store, size, columns, draw):
    """Normalised images [B, 5, H, W] (x and y are 0: the network does not look at them) and classes [B, H, W].

    `store` is what `data.compact` makes of some scans: four images [N, H, W].
    """
    order = seam(size, columns, draw)
    ranges, heights, remission, classes = mix(sectors(store, order, draw), sectors(store, order, draw), draw)
    ranges, heights, remission, classes = pass_van(ranges, heights, remission, classes, draw)
    each = (size, 1, 1)
    # A mount that is not quite level looks as a slope across the image.
    across = torch.linspace(0, math.pi, columns, device=ranges.device)
    heights = heights + ranges * (0.005 * draw.normal(each) * torch.sin(across + draw.uniform(0, 2 * math.pi, each)))
    moved = ranges + added_to_ranges(ranges, classes, draw) + shift_rays(ranges, draw)
    heights = heights * (moved / ranges.clamp(min=1))
    keep = (ranges > 0) & echoes(ranges, draw)
    scale = draw.uniform(0.92, 1.08, each)
    lifted = scale * heights + 0.06 * draw.normal(each)
    image = torch.zeros(size, 5, *ranges.shape[1:], device=ranges.device)
    values = [(0, scale * moved.clamp(min=0.5)), (3, lifted), (4, changed_remission(remission, classes, draw))]
    for channel, values in values:
        image[:, channel] = (values - float(MEANS[channel])) * (keep / float(DEVIATIONS[channel]))
    return image, classes * keep


def seam(size, columns, draw):
    """The columns [B, W] of an image. Where a turn ends next to where it began, what moves is cut off, or is there twice."""
    order = torch.arange(columns, device=draw.device).expand(size, -1)
    jump = (draw.below(25, (size, 1)) - 12) * draw.chance(0.3, (size, 1))
    return (order + jump * (order >= draw.below(columns, (size, 1)))) % columns


def sectors(store, order, draw):
    """Some columns of some scans, from a random one on, at times mirrored."""
    ranges, heights, remission, classes = store
    size, (count, height, width) = len(order), ranges.shape
    way = 1 - 2 * draw.below(2, (size, 1))
    column = (draw.below(width, (size, 1)) + way * order) % width
    row = torch.arange(height, device=draw.device)[None, :, None]
    at = draw.below(count, (size, 1, 1)), row, column[:, None]
    return ranges[at] * RANGE_M, heights[at] * HEIGHT_M, remission[at] * 0.01, classes[at].long()


def lit_rows(ranges):
    """The rows [B, H, 1] that a laser falls into."""
    return (ranges > 0).float().mean(2, keepdim=True) > 0.3


def mix(images, others, draw):
    """Part of another scan's turn in this one, or its loose things wherever they are nearer (PolarMix, Xiao et al. 2022)."""
    ranges, far = images[0], others[0]
    size, _, columns = ranges.shape
    each = (size, 1, 1)
    column = torch.arange(columns, device=ranges.device)
    begin = draw.below(columns, each)
    band = (column >= begin) & (column < begin + draw.below(columns // 2, each))
    loose = torch.tensor([name in LOOSE for name in CLASSES], device=ranges.device)
    # Rows without a laser stay empty.
    lit = (ranges > 0) | lit_rows(ranges)
    nearer = loose[others[3]] & lit & ((ranges == 0) | (far < ranges))
    what = draw.uniform(0, 1, each)
    take = (band & (what < 0.4)) | (nearer & (what >= 0.4) & (what < 0.82))
    return [torch.where(take, other, image) for image, other in zip(images, others)]


def pass_van(ranges, heights, remission, classes, draw):
    """Puts the bare side of a van into a quarter of the images, an arm's length away: it fills the view, with neither wheels nor roof in it."""
    size, rows, columns = ranges.shape
    each = (size, 1, 1)
    down = (torch.arange(rows, device=ranges.device)[:, None] + 0.5) / rows
    pitch = torch.deg2rad(FOV_UP_DEG + (FOV_DOWN_DEG - FOV_UP_DEG) * down)
    step = math.pi / columns  # Training images are half a turn.
    azimuth = (torch.arange(columns, device=ranges.device) - draw.uniform(0.1, 0.9, each) * columns) * step
    facing = azimuth.cos().clamp(min=0.02)
    away = draw.uniform(1.8, 3.6, each)
    side = away / (pitch.cos() * facing)
    along, up = away * azimuth.sin() / facing, side * pitch.sin()
    length = draw.uniform(4, 7, each)
    from_nose = draw.uniform(0, 1, each) * length - along
    top, waist = draw.uniform(-0.1, 1.5, each), draw.uniform(-0.7, -0.4, each)
    low = draw.uniform(0.6, 1.6, each)  # How far the bonnet goes.
    rise = ((from_nose - low) / 0.8).clamp(0, 1)
    roof = torch.where(from_nose < low, waist + 0.2, waist + (top - waist) * rise)
    inside = (from_nose > 0) & (from_nose < length) & (up > draw.uniform(-1.5, -1.1, each)) & (up < roof)
    glass = (from_nose > low + 0.3) & (from_nose < low + 1.3) & (up > waist) & (up < top - 0.2)
    # Rows without a laser, and what the own vehicle hides, stay empty.
    lit = lit_rows(ranges) & ((ranges > 0) | (pitch > -0.2))
    seen = draw.chance(0.25, each) & inside & lit & ((ranges == 0) | (side < ranges))
    paint = draw.uniform(0.02, 0.6, each) * (0.6 + 0.4 * facing)
    label = draw.pick([CLASSES.index("car"), CLASSES.index("car"), CLASSES.index("truck")], each)
    gone = ~(seen & glass & draw.chance(0.7, (size, rows, 1)))
    pairs = [(side, ranges), (up, heights), (paint, remission), (label, classes)]
    return [torch.where(seen, new, old) * gone for new, old in pairs]


def blocks(values, rows, columns, shape):
    """Values [B, h, w] as images, each for a block of rows and columns."""
    return values.repeat_interleave(rows, 1).repeat_interleave(columns, 2)[:, : shape[1], : shape[2]]


def added_to_ranges(ranges, classes, draw):
    """What to add to ranges: noise that grows, lasers that measure too far or too near, leaves that let rays in, high grass."""
    shape = size, height, width = ranges.shape
    each = (size, 1, 1)
    noise = (draw.uniform(0, 0.015, each) + draw.pick([0, 0.001, 0.002], each) * ranges) * draw.normal(shape)
    rows = draw.uniform(0, 0.06, each) * draw.normal((size, height, 1))
    chunks = draw.uniform(0, 0.03, each) * draw.normal((size, height, -(-width // 16)))
    thickness = draw.uniform(0, 0.3, (size, -(-height // 8), -(-width // 32))) * draw.uniform(0, 1, each)
    depth = blocks(thickness, 8, 32, shape) * draw.normal(shape).abs()
    # Blades of grass stop rays before the ground, the earlier the flatter they come.
    grass = 0.15 * depth * ranges * (classes == CLASSES.index("terrain"))
    leaves = depth * (classes == CLASSES.index("vegetation"))
    return noise + rows + blocks(chunks, 1, 16, shape) + leaves - grass


def shift_rays(ranges, draw):
    """What to add to ranges since rays do not hit the middle of their pixels.

    The encoder of a real sensor adds half steps, so that from row to row and from place to place the rays lie
    elsewhere in their pixels: walls that are seen from the side get rough, more so far away.
    """
    size, height, width = ranges.shape
    before, after = ranges.roll(1, 2), ranges.roll(-1, 2)
    slope = 0.5 * (after - before)
    bend = before + after - 2 * ranges
    smooth = (before > 0) & (after > 0) & (slope.abs() < 0.05 * ranges) & (bend.abs() < 0.05 * ranges)
    shift = draw.uniform(0, 0.35, (size, 1, 1)) * draw.uniform(-1, 1, (size, height, -(-width // 16)))
    return slope * blocks(shift, 1, 16, ranges.shape) * smooth


def echoes(ranges, draw):
    """Which echoes come back: some get lost, more at edges, and all of some lasers."""
    shape = size, height, _ = ranges.shape
    each = (size, 1, 1)
    lost = draw.chance(0.5, each) * draw.pick([0.01, 0.05, 0.2], each)
    edges = F.pad(ranges.diff(dim=2).abs() > 0.1 * ranges[:, :, 1:], (1, 0))
    lost = lost + edges * draw.uniform(0, 0.4, each)
    blind = draw.chance(0.2, each) & draw.chance(draw.uniform(0, 0.2, each), (size, height, 1))
    return ~draw.chance(lost, shape) & ~blind


def changed_remission(remission, classes, draw):
    """Other gains, of each row and class too: no class is told by how bright it is in a simulated town.

    More noise; more echoes without a remission, or all of them.
    """
    shape = size, height, _ = remission.shape
    each = (size, 1, 1)
    gains = (draw.uniform(0, 0.3, each) * draw.normal((size, height, 1))).exp()
    of_class = (draw.uniform(0, 0.5, (size, 1)) * draw.normal((size, len(CLASSES)))).exp()
    gains = gains * of_class.gather(1, classes.flatten(1)).view(shape)
    seen = remission ** draw.uniform(0.8, 1.25, each) * draw.uniform(0.6, 1.5, each) * gains
    seen = seen + draw.uniform(0, 0.02, each) * draw.normal(shape)
    there = (remission > 0) & ~draw.chance(draw.pick([0, 0.05, 0.15], each), shape) & ~draw.chance(0.2, each)
    return seen.clamp(0, 1) * there
