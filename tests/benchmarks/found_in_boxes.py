"""Class labels of KITTI raw drive 0005 against its annotated boxes: the one truth on these scans that is no network's.

    python found_in_boxes.py DATA/sequences/90/labels_boxes LABELS...

Only what the camera saw counts: points in boxes of cars and vans (10, 252), in boxes of people and cyclists (30, 253), and
points in no box (1), which is also what was not annotated. Prints IoU, recall and precision for each folder of labels.
"""

import sys
from array import array
from collections import Counter
from pathlib import Path

KINDS = {
    "vehicle": ({10, 252}, {10, 13, 16, 18, 20, 252, 256, 257, 258, 259}),
    "person, cyclist": ({30, 253}, {30, 31, 32, 253, 254, 255}),
}


def labels(file):
    values = array("I")
    values.frombytes(file.read_bytes())
    return [value % 65536 for value in values]


boxes = Path(sys.argv[1])
for folder in map(Path, sys.argv[2:]):
    count = Counter()
    for file in folder.glob("*.label"):
        count.update(zip(labels(boxes / file.name), labels(file), strict=True))
    if not count:
        sys.exit(f"{folder}: no .label files")
    for kind, (boxed, named) in KINDS.items():
        hits = sum(n for (truth, guess), n in count.items() if truth in boxed and guess in named)
        true = sum(n for (truth, _), n in count.items() if truth in boxed)
        said = sum(n for (truth, guess), n in count.items() if truth != 0 and guess in named)
        iou, recall, precision = hits / max(true + said - hits, 1), hits / max(true, 1), hits / max(said, 1)
        print(f"{folder}: {kind}: IoU {iou:.3f}, recall {recall:.3f}, precision {precision:.3f}")
