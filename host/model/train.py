"""Trains the default network on KITTI-layout drives with labels (simulated ones, SemanticKITTI, ...)."""

import argparse
import copy
import itertools
import math
import sys
import time
from pathlib import Path

import torch
from torch.nn import functional as F

from augment import Draw, batch
from data import CLASSES, GROUPS, compact, is_whole, scans
from net import Net


class Store:
    """Compact scans in the memory of the device, 400 KB each. Other processes read them."""

    def __init__(self, args):
        self.args, self.seen, self.coming, self.images, self.count = args, set(), [], [], 0
        self.pool = torch.multiprocessing.get_context("spawn").Pool(args.workers)

    def look(self):
        """Has the scans read that are new in the folders; tells how many are not whole."""
        new = [pair for pair in scans(self.args.folders, self.args.every) if pair not in self.seen]
        whole = [pair for pair in new if is_whole(pair)]
        self.seen.update(whole)
        sizes = self.args.height, self.args.width
        self.coming += [self.pool.apply_async(compact, (pair, *sizes)) for pair in whole]
        return len(new) - len(whole)

    def take(self, wait=False):
        """Adds the scans that have been read; with `wait`, all that were found."""
        coming, self.coming = self.coming, []
        for result in coming:
            if wait or result.ready():
                self.add([torch.from_numpy(image) for image in result.get()])
            else:
                self.coming.append(result)

    def add(self, scan):
        if not self.images or self.count == len(self.images[0]):
            room = max(1000, self.count // 2)
            more = [torch.empty(room, *image.shape, dtype=image.dtype, device=self.args.device) for image in scan]
            self.images = [torch.cat(pair) for pair in zip(self.images, more)] if self.images else more
        for images, image in zip(self.images, scan):
            images[self.count] = image
        self.count += 1

    def fill(self):
        """Reads what is there; ends the program if that is nothing."""
        left_out = self.look()
        self.take(wait=True)
        if left_out:
            print(f"left out: {left_out} scans without a label file of the same length")
        if not self.count:
            sys.exit(f"no scans with labels in {' '.join(self.args.folders)}: name folders with velodyne/ and labels/")

    def batches(self):
        """Training images without end. Scans may be made while training runs."""
        draw, columns = Draw(self.args.device, self.args.seed), int(self.args.width * self.args.share)
        for step in itertools.count(1):
            yield batch([image[: self.count] for image in self.images], self.args.batch, columns, draw)
            if step % 200 == 0:
                self.look()
                self.take()

    def class_weights(self):
        """Rare classes count more, but not so much that they win where they are not."""
        some = self.images[3][: self.count : max(1, self.count // 200)].flatten().long()
        counts = torch.bincount(some, minlength=len(CLASSES)).float()
        share = (counts / counts[1:].sum()).clamp(min=1e-3)
        weights = share**-0.3
        weights[0] = 0
        return weights / (weights * share)[1:].sum()


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
    some = known[torch.randint(len(known), (len(known) // 3,), device=known.device)]
    logits = logits.permute(0, 2, 3, 1).reshape(-1, logits.shape[1])[some].float()
    target = classes.flatten()[some]
    few = slice(0, max(30000, len(some) // 10))
    shares = logits[few].softmax(1) @ groups
    return F.cross_entropy(logits, target, weights) + lovasz(shares, groups.argmax(1)[target[few]])


def save(path, net, args):
    torch.save(
        {"weights": net.state_dict(), "channels": args.channels, "height": args.height, "width": args.width}, path
    )


def train(net, store, args):
    """AdamW; the rate rises and falls with the time spent. Keeps and saves a running mean of the weights."""
    optimiser = torch.optim.AdamW(net.parameters(), lr=args.rate, weight_decay=0.01, fused=True)
    store.fill()
    batches, groups, weights = store.batches(), group_of_class().to(args.device), store.class_weights()
    print(f"{store.count} scans, {sum(p.numel() for p in net.parameters())} parameters", flush=True)
    forward = torch.compile(net) if args.compile else net
    mean, start, shown, step, spent = copy.deepcopy(net), time.time(), 0.0, 0, 0.0
    while spent < 1:
        step += 1
        image, classes = next(batches)
        for group in optimiser.param_groups:
            group["lr"] = args.rate * min(1, step / 50, 0.01 + 0.5 * (1 + math.cos(math.pi * spent)))
        with torch.autocast(image.device.type, torch.bfloat16, enabled=args.bf16):
            logits = forward(image.to(memory_format=torch.channels_last))
        loss = loss_of(logits, classes, weights, groups)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 2.0)
        optimiser.step()
        follow(mean, net, min(0.998, (1 + step) / (10 + step)))
        shown = shown + (loss.detach() - shown) / min(step, 50)
        spent = (time.time() - start) / (60 * args.minutes)
        if step % 50 == 0:
            print(f"step {step}, {spent:.0%} of the time, {store.count} scans: loss {shown:.3f}", flush=True)
            save(args.out, mean, args)
    save(args.out, mean, args)


@torch.no_grad()
def follow(mean, net, keep):
    for a, b in zip(mean.state_dict().values(), net.state_dict().values()):
        a.lerp_(b, 1 - keep) if a.is_floating_point() else a.copy_(b)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", help="sequences/NN folders with velodyne and labels")
    parser.add_argument("--out", type=Path, default=Path("net.pt"))
    parser.add_argument("--start", type=Path, help="a checkpoint to go on from")
    parser.add_argument("--minutes", type=float, default=90, help="how long to train")
    parser.add_argument("--device", default="cpu", help="cpu or cuda")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--every", type=int, default=1, help="take every n-th scan")
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--height", type=int, default=64)
    parser.add_argument("--width", type=int, default=1024)
    parser.add_argument("--share", type=float, default=0.5, help="part of the turn in a training image")
    parser.add_argument("--channels", type=int, nargs=4, default=[24, 48, 64, 96])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1, help="processes that read scans")
    parser.add_argument("--bf16", action="store_true", help="convolve in bfloat16: faster on GPUs, and on CPUs that can")
    parser.add_argument("--compile", action="store_true", help="fuse operations: faster, needs a C++ compiler")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()

    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    net = Net(*args.channels).to(args.device, memory_format=torch.channels_last)
    if args.start:
        net.load_state_dict(torch.load(args.start, weights_only=True, map_location=args.device)["weights"])
    store = Store(args)
    train(net, store, args)
    store.pool.terminate()


if __name__ == "__main__":
    main()
