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

    def __init__(self):
        super().__init__()
        # From logarithm and known pixels: slopes, then bends, along the row and the column; three known in a row, in a column.
        stencils = torch.zeros(6, 2, 3, 3)
        slope, bend = 15 * torch.tensor([-1.0, 0, 1]), 40 * torch.tensor([1.0, -2, 1])
        for row, weights in enumerate([slope, bend]):
            stencils[2 * row, 0, 1] = weights
            stencils[2 * row + 1, 0, :, 1] = weights
        stencils[4, 1, 1] = 1
        stencils[5, 1, :, 1] = 1
        self.register_buffer("stencils", stencils, persistent=False)
        self.register_buffer("offsets", torch.tensor([0.0, 0, 0, 0, -2, -2]), persistent=False)

    def forward(self, image):
        height = image.shape[2]
        valid = (image[:, 0::3].abs().sum(1, keepdim=True) * 1e4).clamp(max=1)
        range_m = image[:, :1] * float(DEVIATIONS[0]) + float(MEANS[0])
        log_range = (range_m.clamp(min=1).log() - 2.3) * valid
        seen = torch.cat([log_range, image[:, 3:], valid], 1)
        seen = seen + (1 - valid) * F.pad(seen, (0, 0, 1, 0))[:, :, :height]
        found = F.conv2d(seen[:, 0::3], self.stencils, self.offsets, padding=1)
        all_known = F.relu(found[:, 4:])
        slopes, bends = ((found[:, k : k + 2] * all_known).clamp(-2, 2) for k in (0, 2))
        return torch.cat([seen, slopes, bends], 1)


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
