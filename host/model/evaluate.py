"""IoU of a network on KITTI-layout drives with labels, for each class and each group of classes."""

import argparse
from pathlib import Path

import numpy as np
import torch

from data import CLASSES, GROUPS, pixels, project, read, scans
from net import Net


def load(path):
    """A function from an image [5, H, W] to logits [20, H, W], with H and W."""
    if path.suffix == ".onnx":
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(path, options)
        name, shape = session.get_inputs()[0].name, session.get_inputs()[0].shape
        return lambda image: session.run(None, {name: image[None]})[0][0], shape[2], shape[3]
    saved = torch.load(path, weights_only=True)
    net = Net(*saved["channels"])
    net.load_state_dict(saved["weights"])
    net.eval()

    @torch.no_grad()
    def run(image):
        return net(torch.from_numpy(image)[None])[0].numpy()

    return run, saved["height"], saved["width"]


def vote(image_ranges, image_classes, ranges, row, column, k=5, window=5, sigma=1.0, cutoff_m=1.0):
    """RangeNet++'s post-processing: the classes of the points nearest in range around each pixel."""
    reach, (height, width) = window // 2, image_ranges.shape
    offsets = [(dv, du) for dv in range(-reach, reach + 1) for du in range(-reach, reach + 1)]
    gauss = np.exp(-np.array([dv * dv + du * du for dv, du in offsets]) / (2 * sigma**2))
    padded = np.pad(image_ranges, reach, constant_values=np.inf)
    classes = np.pad(image_classes, reach)
    distance = np.empty((len(offsets), len(ranges)), np.float32)
    votes = np.empty((len(offsets), len(ranges)), np.uint8)
    for index, (dv, du) in enumerate(offsets):
        at = row + reach + dv, column + reach + du
        near = np.abs(padded[at] - ranges) if (dv, du) != (0, 0) else 0.0
        distance[index] = near * (1 - gauss[index] / gauss.sum())
        votes[index] = classes[at]
    nearest = np.argpartition(distance, k - 1, axis=0)[:k]
    votes = np.take_along_axis(votes, nearest, 0)
    votes[np.take_along_axis(distance, nearest, 0) > cutoff_m] = 0
    tally = np.stack([(votes == c).sum(0) for c in range(1, len(CLASSES))])
    return 1 + tally.argmax(0)


def predict(run, points, height, width):
    """Class of each point."""
    image, _ = project(points, np.zeros(points.shape[1], np.uint8), height, width)
    logits = run(np.ascontiguousarray(image))
    logits[0] = -np.inf
    ranges, row, column = pixels(points, height, width)
    nearest = np.full((height, width), np.inf, np.float32)
    np.minimum.at(nearest, (row, column), ranges)
    return vote(nearest, logits.argmax(0).astype(np.uint8), ranges, row, column)


def confusion(run, pairs, height, width):
    """Points by true and predicted class; unlabeled points are left out."""
    table = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    for pair in pairs:
        points, labels = read(pair)
        guess = predict(run, points, height, width)
        table += np.bincount(labels.astype(np.int64) * 20 + guess, minlength=400).reshape(20, 20)
    table[0] = 0
    return table


def iou(table):
    """Of each class; NaN where there is nothing of it."""
    hits = table.diagonal()
    union = table.sum(0) + table.sum(1) - hits
    return np.where(table.sum(1) > 0, hits / np.maximum(union, 1), np.nan)


def grouped(table):
    """The confusion between groups; last: all other classes."""
    group = np.full(len(CLASSES), len(GROUPS))
    for index, members in enumerate(GROUPS.values()):
        group[members] = index
    folded = np.zeros((len(GROUPS) + 1,) * 2, np.int64)
    np.add.at(folded, (group[:, None], group[None, :]), table)
    return folded


def report(table, with_matrix):
    lines = [f"{name:14s} {value:6.3f} {share:7.4f}" for name, value, share in
             zip(CLASSES, iou(table), table.sum(1) / table.sum()) if share > 0]
    lines.append(f"{'mean of classes':14s} {np.nanmean(iou(table)[1:]):6.3f}")
    groups = grouped(table)
    scores = iou(groups)[: len(GROUPS)]
    lines += [f"{name:20s} {value:6.3f}" for name, value in zip(GROUPS, scores)]
    lines.append(f"{'mean of groups':20s} {np.nanmean(scores):6.3f}")
    if with_matrix:
        percent = 100 * groups / np.maximum(groups.sum(1, keepdims=True), 1)
        names = [*GROUPS, "other"]
        lines += [f"{name:20s}" + "".join(f"{p:7.1f}" for p in row) for name, row in zip(names, percent)]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path, help="a checkpoint of train.py, or an ONNX file")
    parser.add_argument("folders", nargs="+", help="sequences/NN folders with velodyne and labels")
    parser.add_argument("--every", type=int, default=1, help="take every n-th scan")
    parser.add_argument("--matrix", action="store_true", help="print the confusion of the groups, in % of the rows")
    args = parser.parse_args()
    torch.set_num_threads(1)
    run, height, width = load(args.model)
    print(report(confusion(run, scans(args.folders, args.every), height, width), args.matrix))


if __name__ == "__main__":
    main()
