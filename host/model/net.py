"""The default network: RangeNet++'s tensor contract, small enough for one CPU core."""

import torch
from torch import nn
from torch.nn import functional as F

from data import CLASSES, DEVIATIONS, MEANS


class Features(nn.Module):
    """What a scan tells wherever the sensor looks: no x and y, but the logarithm of the range, its slopes and bends.

    A slope of the logarithm looks the same near and far. Rows that no laser of a sensor falls into are filled from
    the row above, so that slopes and bends do not tell sensors apart.
    """

    def forward(self, image):
        height, width = image.shape[2:]
        valid = (image.abs().sum(1, keepdim=True) * 1e4).clamp(max=1)
        range_m = image[:, :1] * float(DEVIATIONS[0]) + float(MEANS[0])
        log_range = (range_m.clamp(min=1).log() - 2.3) * valid
        seen = torch.cat([log_range, image[:, 3:], valid], 1)
        seen = seen + (1 - valid) * F.pad(seen, (0, 0, 1, 0))[:, :, :height]
        log_range, known = seen[:, :1], seen[:, 3:]
        # Neighbours: left, right, above, below; what is outside of the image is not known.
        ranges, there = (F.pad(x, (1, 1, 1, 1)) for x in (log_range, known))
        steps = [(slice(1, 1 + height), slice(0, width)), (slice(1, 1 + height), slice(2, 2 + width)),
                 (slice(0, height), slice(1, 1 + width)), (slice(2, 2 + height), slice(1, 1 + width))]
        slopes, bends = [], []
        for before, after in (steps[:2], steps[2:]):
            before, after, both = ranges[:, :, *before], ranges[:, :, *after], there[:, :, *before] * there[:, :, *after]
            inside = known * both
            slopes.append(((after - before) * (15 * inside)).clamp(-2, 2))
            bends.append(((after + before - 2 * log_range) * (40 * inside)).clamp(-2, 2))
        return torch.cat([seen, *slopes, *bends], 1)


def conv(inputs, outputs, stride=1, dilation=1):
    """3x3 with batch norm and ReLU; dilated along the rows only."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, (1, dilation), (1, dilation), bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


def up(inputs, outputs):
    return nn.Sequential(nn.ConvTranspose2d(inputs, outputs, 2, 2, bias=False), nn.BatchNorm2d(outputs))


class Residual(nn.Module):
    def __init__(self, channels, dilation=1):
        super().__init__()
        self.first = conv(channels, channels, dilation=dilation)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels)
        )
        nn.init.zeros_(self.second[1].weight)  # Begins as the identity.

    def forward(self, x):
        return F.relu(x + self.second(self.first(x)))


class Net(nn.Module):
    """A U-Net on a range image: 1/2 to 1/16 of its size. [B, 5, H, W] to logits [B, 20, H, W]."""

    def __init__(self, a=24, b=48, c=64, d=96):
        super().__init__()
        self.features = Features()
        self.down2 = nn.Sequential(conv(8, a, 2), conv(a, a))
        self.down4 = nn.Sequential(conv(a, b, 2), Residual(b))
        self.down8 = nn.Sequential(conv(b, c, 2), Residual(c), Residual(c, 2))
        self.down16 = nn.Sequential(conv(c, d, 2), Residual(d, 2), Residual(d, 4), Residual(d, 2))
        self.up8, self.mix8 = up(d, c), conv(c, c)
        self.up4, self.mix4 = up(c, b), conv(b, b)
        self.up2, self.mix2 = up(b, a), conv(a, a)
        self.head = nn.ConvTranspose2d(a, len(CLASSES), 2, 2)

    def forward(self, image):
        with torch.autocast(image.device.type, enabled=False):
            features = self.features(image)
        x2 = self.down2(features)
        x4 = self.down4(x2)
        x8 = self.down8(x4)
        x8 = self.mix8(F.relu(x8 + self.up8(self.down16(x8))))
        x4 = self.mix4(F.relu(x4 + self.up4(x8)))
        x2 = self.mix2(F.relu(x2 + self.up2(x4)))
        return self.head(x2)
