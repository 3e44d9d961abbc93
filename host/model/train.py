"""Trains the default network on KITTI-layout drives with labels (simulated ones, SemanticKITTI, ...)."""

import argparse
import copy
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from data import CLASSES, GROUPS, augment, compact, mix, read, scans, sector
from net import Net


class Sectors(torch.utils.data.IterableDataset):
    """Augmented parts of scans without end. Each round looks for new scans, so that they may be made meanwhile.

    Scans are kept in memory, 400 KB each.
    """

    def __init__(self, args):
        self.args = args

    def worker(self):
        info = torch.utils.data.get_worker_info()
        return info.id if info else 0

    def __iter__(self):
        args, random, seen = self.args, np.random.default_rng([self.args.seed, self.worker()]), {}

        def part(pair):
            if pair not in seen:
                seen[pair] = compact(pair, args.height, args.width)
            return sector(seen[pair], int(args.width * args.share), random)

        while True:
            pairs = scans(args.folders, args.every)
            for index in random.permutation(len(pairs)):
                other = list(seen)[random.integers(len(seen))] if seen else pairs[index]
                image, classes = augment(mix(part(pairs[index]), part(other), random), random)
                yield image, classes.astype(np.int64)


def class_weights(pairs):
    """Rare classes count more, but not so much that they win where they are not."""
    counts = sum(np.bincount(read(pair)[1], minlength=len(CLASSES)) for pair in pairs[:: max(1, len(pairs) // 100)])
    share = np.maximum(counts / counts[1:].sum(), 1e-3)
    weights = share**-0.3
    weights[0] = 0
    return torch.tensor(weights / (weights * share)[1:].sum(), dtype=torch.float32)


def lovasz(shares, target):
    """Lovasz-softmax over what is present: a loss that follows the IoU (Berman et al. 2018)."""
    losses = []
    for index in target.unique():
        foreground = (target == index).float()
        errors, order = (foreground - shares[:, index]).abs().sort(descending=True)
        foreground = foreground[order]
        hits = foreground.sum() - foreground.cumsum(0)
        union = foreground.sum() + (1 - foreground).cumsum(0)
        jaccard = 1 - hits / union
        losses.append(errors @ torch.cat([jaccard[:1], jaccard[1:] - jaccard[:-1]]))
    return torch.stack(losses).mean()


def group_of_class():
    """A matrix that sums the classes of each group; what is in no group is one of its own."""
    matrix = torch.zeros(len(CLASSES), len(GROUPS) + 1)
    for group, members in enumerate(GROUPS.values()):
        matrix[members, group] = 1
    matrix[matrix.sum(1) == 0, -1] = 1
    return matrix


def loss_of(logits, classes, weights, groups):
    """Cross entropy of the classes, and the IoU of the groups, at some of the pixels: all would cost more than the network."""
    known = (classes.flatten() > 0).nonzero().flatten()
    some = known[torch.randint(len(known), (len(known) // 3,))]
    logits = logits.permute(0, 2, 3, 1).reshape(-1, logits.shape[1])[some].float()
    target = classes.flatten()[some]
    few = slice(0, 30000)
    shares = logits[few].softmax(1) @ groups
    return F.cross_entropy(logits, target, weights) + lovasz(shares, groups.argmax(1)[target[few]])


def save(path, net, args):
    torch.save(
        {"weights": net.state_dict(), "channels": args.channels, "height": args.height, "width": args.width}, path
    )


def train(net, batches, weights, args):
    """AdamW; the rate rises and falls with the time spent. Keeps and saves a running mean of the weights."""
    optimiser = torch.optim.AdamW(net.parameters(), lr=args.rate, weight_decay=0.01, fused=True)
    groups = group_of_class()
    forward = torch.compile(net) if args.compile else net
    mean, start, shown, step, spent = copy.deepcopy(net), time.time(), 0.0, 0, 0.0
    for step, (image, classes) in enumerate(batches, 1):
        spent = (time.time() - start) / (60 * args.minutes)
        if spent > 1:
            break
        for group in optimiser.param_groups:
            group["lr"] = args.rate * min(1, step / 50, 0.01 + 0.5 * (1 + math.cos(math.pi * spent)))
        with torch.autocast("cpu", torch.bfloat16, enabled=args.bf16):
            logits = forward(image.to(memory_format=torch.channels_last))
        loss = loss_of(logits, classes, weights, groups)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 2.0)
        optimiser.step()
        follow(mean, net, min(0.998, (1 + step) / (10 + step)))
        shown += (loss.item() - shown) / min(step, 50)
        if step % 50 == 0:
            print(f"step {step}, {spent:.0%} of the time: loss {shown:.3f}", flush=True)
            save(args.out, mean, args)
    save(args.out, mean, args)


def follow(mean, net, keep):
    with torch.no_grad():
        for a, b in zip(mean.state_dict().values(), net.state_dict().values()):
            a.lerp_(b, 1 - keep) if a.is_floating_point() else a.copy_(b)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", help="sequences/NN folders with velodyne and labels")
    parser.add_argument("--out", type=Path, default=Path("net.pt"))
    parser.add_argument("--start", type=Path, help="a checkpoint to go on from")
    parser.add_argument("--minutes", type=float, default=90, help="how long to train")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--every", type=int, default=1, help="take every n-th scan")
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--height", type=int, default=64)
    parser.add_argument("--width", type=int, default=1024)
    parser.add_argument("--share", type=float, default=0.5, help="part of the turn in a training image")
    parser.add_argument("--channels", type=int, nargs=4, default=[24, 48, 64, 96])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=0, help="processes that prepare images")
    parser.add_argument("--bf16", action="store_true", help="convolve in bfloat16: faster on CPUs that can")
    parser.add_argument("--compile", action="store_true", help="fuse operations: faster, needs a C++ compiler")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()

    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    pairs = scans(args.folders, args.every)
    weights = class_weights(pairs)
    net = Net(*args.channels).to(memory_format=torch.channels_last)
    if args.start:
        net.load_state_dict(torch.load(args.start, weights_only=True)["weights"])
    print(f"{len(pairs)} scans, {sum(p.numel() for p in net.parameters())} parameters")
    train(net, torch.utils.data.DataLoader(Sectors(args), args.batch, num_workers=args.workers), weights, args)


if __name__ == "__main__":
    main()
