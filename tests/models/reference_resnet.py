"""ResNet and PSPNet written with the names of torchvision and hszhao/semseg, independently of `stsem.models`.

Any width: `planes` are the channels of the four stages before expansion.
"""

import torch
from torch import nn
from torch.nn import functional


class Basic(nn.Module):
    expansion = 1

    def __init__(self, cin, planes, stride, down):
        super().__init__()
        self.conv1, self.bn1 = nn.Conv2d(cin, planes, 3, stride, 1, bias=False), nn.BatchNorm2d(planes)
        self.conv2, self.bn2 = nn.Conv2d(planes, planes, 3, 1, 1, bias=False), nn.BatchNorm2d(planes)
        self.downsample = down

    def forward(self, x):
        y = self.bn2(self.conv2(functional.relu(self.bn1(self.conv1(x)))))
        return functional.relu(y + (x if self.downsample is None else self.downsample(x)))


class Bottle(nn.Module):
    expansion = 4

    def __init__(self, cin, planes, stride, down):
        super().__init__()
        self.conv1, self.bn1 = nn.Conv2d(cin, planes, 1, bias=False), nn.BatchNorm2d(planes)
        self.conv2, self.bn2 = nn.Conv2d(planes, planes, 3, stride, 1, bias=False), nn.BatchNorm2d(planes)
        self.conv3, self.bn3 = nn.Conv2d(planes, 4 * planes, 1, bias=False), nn.BatchNorm2d(4 * planes)
        self.downsample = down

    def forward(self, x):
        y = functional.relu(self.bn1(self.conv1(x)))
        y = self.bn3(self.conv3(functional.relu(self.bn2(self.conv2(y)))))
        return functional.relu(y + (x if self.downsample is None else self.downsample(x)))


def stage(block, cin, planes, count, stride):
    cout = planes * block.expansion
    down = None
    if stride != 1 or cin != cout:
        down = nn.Sequential(nn.Conv2d(cin, cout, 1, stride, bias=False), nn.BatchNorm2d(cout))
    blocks = [block(cin, planes, stride, down)]
    return nn.Sequential(*blocks, *(block(cout, planes, 1, None) for _ in range(count - 1))), cout


def dilate(layer, rate):
    """What semseg does to stages 4 and 5."""
    for name, module in layer.named_modules():
        if name.endswith("conv2"):
            module.dilation = module.padding = (rate, rate)
            module.stride = (1, 1)
        elif name.endswith("downsample.0"):
            module.stride = (1, 1)


class TorchvisionResNet(nn.Module):
    def __init__(self, block, counts, planes, stem, classes=7):
        super().__init__()
        self.conv1, self.bn1 = nn.Conv2d(3, stem, 7, 2, 3, bias=False), nn.BatchNorm2d(stem)
        self.layer1, c = stage(block, stem, planes[0], counts[0], 1)
        self.layer2, c = stage(block, c, planes[1], counts[1], 2)
        self.layer3, c = stage(block, c, planes[2], counts[2], 2)
        self.layer4, c = stage(block, c, planes[3], counts[3], 2)
        self.fc = nn.Linear(c, classes)

    def forward(self, x):
        x = functional.max_pool2d(functional.relu(self.bn1(self.conv1(x))), 3, 2, 1)
        middle = self.layer3(self.layer2(self.layer1(x)))
        return middle, self.layer4(middle)


class Pool(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.features = nn.ModuleList(
            nn.Sequential(
                nn.AdaptiveAvgPool2d(n), nn.Conv2d(channels, channels // 4, 1, bias=False),
                nn.BatchNorm2d(channels // 4), nn.ReLU(),
            )
            for n in (1, 2, 3, 6)
        )  # fmt: skip

    def forward(self, x):
        parts = [functional.interpolate(f(x), x.shape[2:], mode="bilinear", align_corners=True) for f in self.features]
        return torch.cat([x, *parts], 1)


class SemsegPSPNet(nn.Module):
    """On bottlenecks, with a stem of three 3x3 convolutions."""

    def __init__(self, counts, planes, stem, head, aux, classes):
        super().__init__()
        a, b = stem
        self.layer0 = nn.Sequential(
            nn.Conv2d(3, a, 3, 2, 1, bias=False), nn.BatchNorm2d(a), nn.ReLU(),
            nn.Conv2d(a, a, 3, 1, 1, bias=False), nn.BatchNorm2d(a), nn.ReLU(),
            nn.Conv2d(a, b, 3, 1, 1, bias=False), nn.BatchNorm2d(b), nn.ReLU(), nn.MaxPool2d(3, 2, 1),
        )  # fmt: skip
        self.layer1, c = stage(Bottle, b, planes[0], counts[0], 1)
        self.layer2, c = stage(Bottle, c, planes[1], counts[1], 2)
        self.layer3, middle = stage(Bottle, c, planes[2], counts[2], 2)
        self.layer4, c = stage(Bottle, middle, planes[3], counts[3], 2)
        dilate(self.layer3, 2)
        dilate(self.layer4, 4)
        self.ppm = Pool(c)
        self.cls = self._head(2 * c, head, classes)
        self.aux = self._head(middle, aux, classes)

    @staticmethod
    def _head(cin, channels, classes):
        return nn.Sequential(
            nn.Conv2d(cin, channels, 3, padding=1, bias=False), nn.BatchNorm2d(channels), nn.ReLU(),
            nn.Dropout2d(0.1), nn.Conv2d(channels, classes, 1),
        )  # fmt: skip

    def forward(self, x):
        middle = self.layer3(self.layer2(self.layer1(self.layer0(x))))
        return self.cls(self.ppm(self.layer4(middle))), self.aux(middle)


def lively(module):
    """Statistics and factors of normalisation that are not all 0 and 1, and evaluation mode."""
    generator = torch.Generator().manual_seed(5)
    for part in module.modules():
        if isinstance(part, nn.BatchNorm2d):
            for value, low, high in ((part.weight, 0.5, 1.5), (part.bias, -0.2, 0.2), (part.running_mean, -0.2, 0.2),
                                     (part.running_var, 0.5, 2.0)):  # fmt: skip
                value.data.uniform_(low, high, generator=generator)
    return module.eval()
