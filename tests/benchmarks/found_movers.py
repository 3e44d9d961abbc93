"""In how many frames a run calls the van and the cyclist of KITTI raw drive 0005 moving.

    python found_movers.py DATA/sequences/90/labels_boxes OUT/90/motion

Boxes hold the object in the upper half of a label (0: the van, 1: the cyclist, plus 1) and 252 or 253 in the lower where it
moves. An object is found in a frame when more than half of its points are called moving. Frames with fewer than ten of its
points do not count, nor do the first two: nothing can be known to move before.
"""

import sys
from array import array
from pathlib import Path

boxes, motion = map(Path, sys.argv[1:3])


def labels(file):
    values = array("I")
    values.frombytes(file.read_bytes())
    return values


for name, track in (("van", 1), ("cyclist", 2)):
    seen = found = points = right = 0
    for file in sorted(motion.glob("*.label"))[2:]:
        truth, guess = labels(boxes / file.name), labels(file)
        moving = [250 < g % 65536 < 260 for t, g in zip(truth, guess) if t >> 16 == track and t % 65536 in (252, 253)]
        if len(moving) < 10:
            continue
        seen += 1
        found += 2 * sum(moving) > len(moving)
        points += len(moving)
        right += sum(moving)
    print(f"{name}: moving in {found} of {seen} frames, {100 * right / max(points, 1):.1f} % of its points")
