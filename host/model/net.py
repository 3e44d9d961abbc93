"""The default network: RangeNet++'s tensor contract, small enough for one CPU core."""

import torch
from torch import nn
from torch.nn import functional as F

from data import CLASSES, DEVIATIONS, MEANS


class Features(nn.Module):
    """What a scan tells wherever the sensor looks: no x and y, but the logarithm of the range and its steps.

    A step of the logarithm is a slope; it looks the same near and far.
    """

    def __init__(self):
        super().__init__()
        steps = torch.zeros(2, 1, 3, 3)
        steps[0, 0, 1, 2], steps[0, 0, 1, 0] = 1, -1
        steps[1, 0, 2, 1], steps[1, 0, 0, 1] = 1, -1
        self.register_buffer("steps", 15 * steps)

    def forward(self, image):
        valid = (image.abs().sum(1, keepdim=True) * 1e4).clamp(max=1)
        range_m = image[:, :1] * float(DEVIATIONS[0]) + float(MEANS[0])
        log_range = (range_m.clamp(min=1).log() - 2.3) * valid
        steps = F.conv2d(log_range, self.steps, padding=1).clamp(-2, 2)
        return torch.cat([log_range, image[:, 3:], valid, steps], 1)


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

    def forward(self, x):
        return F.relu(x + self.second(self.first(x)))


class Net(nn.Module):
    """A U-Net on a range image: 1/2, 1/4 and 1/8 of its size. [B, 5, H, W] to logits [B, 20, H, W]."""

    def __init__(self, a=20, b=40, c=56):
        super().__init__()
        self.features = Features()
        self.down2 = nn.Sequential(conv(6, a, 2), conv(a, a))
        self.down4 = nn.Sequential(conv(a, b, 2), Residual(b))
        self.down8 = nn.Sequential(conv(b, c, 2), Residual(c), Residual(c, 2))
        self.up4, self.mix4 = up(c, b), conv(b, b)
        self.up2, self.mix2 = up(b, a), conv(a, a)
        self.head = nn.ConvTranspose2d(a, len(CLASSES), 2, 2)

    def forward(self, image):
        x2 = self.down2(self.features(image))
        x4 = self.down4(x2)
        x4 = self.mix4(F.relu(x4 + self.up4(self.down8(x4))))
        x2 = self.mix2(F.relu(x2 + self.up2(x4)))
        return self.head(x2)
