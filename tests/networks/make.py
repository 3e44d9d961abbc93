"""Makes the small random networks of this folder and what ONNX Runtime says of them.

    python tests/networks/make.py
    python tests/networks/make.py --full FOLDER [NAME]

The second makes the networks, or one, as wide as published, for 64 x 2048 pixels and 20 classes: to measure times. Needs torch, onnx and onnxruntime (made with torch 2.15, onnx 1.23, onnxruntime 1.32). Each network has the architecture of
a published one in narrow: layers, strides, paddings and operators are the same, channels are few. Weights are random.
For each: NAME.onnx, and NAME.f32, the output [6, 16, 64] for the image that `image()` below and the Rust test both make.
"""

import sys
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from torch import nn
from torch.nn import functional as F

FULL = sys.argv[1:2] == ["--full"]
CLASSES, HEIGHT, WIDTH = (20, 64, 2048) if FULL else (6, 16, 64)


def image():
    """Numbers of -2 to 2 in steps of 2^-14, from the upper half of a multiplicative hash of their index."""
    index = np.arange(5 * HEIGHT * WIDTH, dtype=np.uint64)
    hashed = (index * 2654435761 + 12345) % 2**32 // 2**16
    return (hashed.astype(np.float32) / 2**14 - 2).reshape(1, 5, HEIGHT, WIDTH)


def conv(inputs, outputs, kernel=3, stride=(1, 1), padding=None, bias=False):
    padding = kernel // 2 if padding is None else padding
    return nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=bias)


def conv_bn(inputs, outputs, kernel=3, stride=(1, 1), activation=nn.LeakyReLU(0.1)):
    return nn.Sequential(conv(inputs, outputs, kernel, stride), nn.BatchNorm2d(outputs), activation)


def up_along_rows(inputs, outputs):
    return nn.ConvTranspose2d(inputs, outputs, (1, 4), (1, 2), (0, 1))


# ---- RangeNet: Darknet with strides along the rows only ----


class DarkBlock(nn.Module):
    """No activation after the sum."""

    def __init__(self, channels, narrow):
        super().__init__()
        self.layers = nn.Sequential(conv_bn(channels, narrow, 1), conv_bn(narrow, channels))

    def forward(self, x):
        return x + self.layers(x)


class RangeNet(nn.Module):
    """`blocks` per stage: 1, 1, 2, 2, 1 is darknet21, 1, 2, 8, 8, 4 is darknet53. The published widths are 32 to 1024."""

    def __init__(self, blocks, widths):
        super().__init__()
        self.stem = conv_bn(5, widths[0])
        self.down, self.up = nn.ModuleList(), nn.ModuleList()
        for inputs, outputs, count in zip(widths, widths[1:], blocks):
            blocks_of_stage = [DarkBlock(outputs, max(1, outputs // 2)) for _ in range(count)]
            self.down.append(nn.Sequential(conv_bn(inputs, outputs, stride=(1, 2)), *blocks_of_stage))
        for inputs, outputs in zip(widths[::-1], widths[-2::-1]):
            activated = nn.Sequential(up_along_rows(inputs, outputs), nn.BatchNorm2d(outputs), nn.LeakyReLU(0.1))
            self.up.append(nn.Sequential(activated, DarkBlock(outputs, inputs)))
        self.head = conv(widths[0], CLASSES, bias=True)

    def forward(self, x):
        x = self.stem(x)
        skips = []
        for stage in self.down:
            skips.append(x)
            x = stage(x)
        for stage in self.up:
            x = stage(x) + skips.pop()
        return F.softmax(self.head(x), dim=1)


# ---- SqueezeSegV2 ----


class Context(nn.Module):
    """Context aggregation: every pixel weighted by what is around it."""

    def __init__(self, channels):
        super().__init__()
        self.pool = nn.MaxPool2d(7, 1, 3)
        narrow = max(2, channels // 16)
        self.squeeze = conv_bn(channels, narrow, 1, activation=nn.ReLU())
        self.excite = conv_bn(narrow, channels, 1, activation=nn.Sigmoid())

    def forward(self, x):
        return x * self.excite(self.squeeze(self.pool(x)))


class Fire(nn.Module):
    def __init__(self, inputs, outputs, up=False):
        super().__init__()
        squeezed = max(2, outputs // (4 if up else 8))
        self.squeeze = conv_bn(inputs, squeezed, 1, activation=nn.ReLU())
        self.up = nn.Sequential(up_along_rows(squeezed, squeezed), nn.ReLU()) if up else nn.Identity()
        self.one = conv_bn(squeezed, outputs // 2, 1, activation=nn.ReLU())
        self.three = conv_bn(squeezed, outputs // 2, 3, activation=nn.ReLU())

    def forward(self, x):
        x = self.up(self.squeeze(x))
        return torch.cat([self.one(x), self.three(x)], 1)


class SqueezeSegV2(nn.Module):
    """The published widths are 64, 128, 256, 384 and 512."""

    def __init__(self, widths):
        super().__init__()
        a, b, c, d, e = widths
        pool = lambda: nn.MaxPool2d(3, (1, 2), 1)
        self.stem = nn.Sequential(conv_bn(5, a, stride=(1, 2), activation=nn.ReLU()), Context(a))
        self.skip = nn.Sequential(conv(5, a, 1), nn.BatchNorm2d(a))
        self.fire2 = nn.Sequential(pool(), Fire(a, b), Context(b), Fire(b, b), Context(b))
        self.fire4 = nn.Sequential(pool(), Fire(b, c), Fire(c, c))
        self.fire6 = nn.Sequential(pool(), Fire(c, d), Fire(d, d), Fire(d, e), Fire(e, e))
        self.up4, self.up2 = Fire(e, c, up=True), Fire(c, b, up=True)
        self.up1, self.up0 = Fire(b, a, up=True), Fire(a, a, up=True)
        self.head = conv(a, CLASSES, bias=True)

    def forward(self, x):
        skip, x1 = self.skip(x), self.stem(x)
        x2 = self.fire2(x1)
        x4 = self.fire4(x2)
        x = self.up4(self.fire6(x4)) + x4
        x = self.up2(x) + x2
        x = self.up1(x) + x1
        return F.softmax(self.head(self.up0(x) + skip), dim=1)


# ---- SalsaNext ----


def conv_act_bn(inputs, outputs, kernel=3, padding=1, dilation=1):
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, padding=padding, dilation=dilation), nn.LeakyReLU(), nn.BatchNorm2d(outputs)
    )


class SalsaContext(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.shortcut = nn.Sequential(nn.Conv2d(inputs, outputs, 1), nn.LeakyReLU())
        self.layers = nn.Sequential(conv_act_bn(outputs, outputs), conv_act_bn(outputs, outputs, padding=2, dilation=2))

    def forward(self, x):
        x = self.shortcut(x)
        return x + self.layers(x)


class SalsaMix(nn.Module):
    """Three convolutions with growing reach, side by side."""

    def __init__(self, inputs, outputs):
        super().__init__()
        self.first = conv_act_bn(inputs, outputs)
        self.second = conv_act_bn(outputs, outputs, padding=2, dilation=2)
        self.third = conv_act_bn(outputs, outputs, kernel=2, padding=1, dilation=2)
        self.mix = conv_act_bn(3 * outputs, outputs, 1, 0)

    def forward(self, x):
        a = self.first(x)
        b = self.second(a)
        return self.mix(torch.cat([a, b, self.third(b)], 1))


class SalsaDown(nn.Module):
    def __init__(self, inputs, outputs, pool=True):
        super().__init__()
        self.shortcut = nn.Sequential(nn.Conv2d(inputs, outputs, 1), nn.LeakyReLU())
        self.mix = SalsaMix(inputs, outputs)
        self.pool = nn.AvgPool2d(3, 2, 1) if pool else nn.Identity()

    def forward(self, x):
        x = self.shortcut(x) + self.mix(x)
        return self.pool(x), x


class SalsaUp(nn.Module):
    def __init__(self, inputs, skip, outputs):
        super().__init__()
        self.mix = SalsaMix(inputs // 4 + skip, outputs)

    def forward(self, x, skip):
        return self.mix(torch.cat([F.pixel_shuffle(x, 2), skip], 1))


class SalsaNext(nn.Module):
    """The published width is 32."""

    def __init__(self, width):
        super().__init__()
        w = width
        self.context = nn.Sequential(SalsaContext(5, w), SalsaContext(w, w), SalsaContext(w, w))
        shapes = [(w, 2 * w), (2 * w, 4 * w), (4 * w, 4 * w), (4 * w, 4 * w)]
        self.down = nn.ModuleList([SalsaDown(*shape) for shape in shapes])
        self.bottom = SalsaDown(4 * w, 4 * w, pool=False)
        ups = [(4 * w, 4 * w, 4 * w), (4 * w, 4 * w, 4 * w), (4 * w, 4 * w, 2 * w), (2 * w, 2 * w, 2 * w)]
        self.up = nn.ModuleList([SalsaUp(*shape) for shape in ups])
        self.head = nn.Conv2d(2 * w, CLASSES, 1)

    def forward(self, x):
        x = self.context(x)
        skips = []
        for stage in self.down:
            x, skip = stage(x)
            skips.append(skip)
        x, _ = self.bottom(x)
        for stage in self.up:
            x = stage(x, skips.pop())
        return F.softmax(self.head(x), dim=1)


def randomise(net):
    """Statistics and weights that keep the signal's size, so that no layer is without effect."""
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            nn.init.uniform_(module.running_mean, -0.3, 0.3)
            nn.init.uniform_(module.running_var, 0.5, 1.5)
            nn.init.uniform_(module.weight, 0.7, 1.4)
            nn.init.uniform_(module.bias, -0.3, 0.3)
        elif isinstance(module, (nn.Conv2d, nn.ConvTranspose2d)):
            nn.init.kaiming_uniform_(module.weight, a=0.5)
    return with_even_classes(net.eval())


@torch.no_grad()
def with_even_classes(net):
    """The same network with a head under which every class wins somewhere and no probability is 0 or 1."""
    logits = []
    hook = net.head.register_forward_hook(lambda module, inputs, output: logits.append(output))
    net(torch.from_numpy(image()))
    hook.remove()
    scale = 1.5 / logits[0].std((0, 2, 3))
    net.head.bias.sub_(logits[0].mean((0, 2, 3))).mul_(scale)
    net.head.weight.mul_(scale[:, None, None, None])
    return net


def networks():
    """Name and what makes it."""
    darknet = (32, 64, 128, 256, 512, 1024) if FULL else (3, 4, 6, 8, 10, 12)
    squeezeseg = (64, 128, 256, 384, 512) if FULL else (4, 6, 8, 10, 12)
    yield "darknet21", lambda: RangeNet((1, 1, 2, 2, 1), darknet)
    yield "darknet53", lambda: RangeNet((1, 2, 8, 8, 4), darknet)
    yield "squeezesegv2", lambda: SqueezeSegV2(squeezeseg)
    yield "salsanext", lambda: SalsaNext(32 if FULL else 2)


def main():
    folder, *wanted = sys.argv[2:] if FULL else [Path(__file__).parent]
    for seed, (name, make) in enumerate(networks()):
        if wanted and name not in wanted:
            continue
        torch.manual_seed(seed)
        net = randomise(make())
        file = Path(folder) / f"{name}.onnx"
        torch.onnx.export(net, (torch.from_numpy(image()),), file, opset_version=17, dynamo=False)
        print(f"{name}: {file.stat().st_size} bytes, {sum(p.numel() for p in net.parameters())} parameters")
        if FULL:
            continue
        session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
        output = session.run(None, {session.get_inputs()[0].name: image()})[0]
        output.astype("<f4").tofile(Path(folder) / f"{name}.f32")
        shares = np.bincount(output[0].argmax(0).ravel(), minlength=CLASSES) / (HEIGHT * WIDTH)
        print(f"  shares of the classes {np.round(shares, 2)}, probabilities {output.min():.3f} to {output.max():.3f}")


if __name__ == "__main__":
    main()
