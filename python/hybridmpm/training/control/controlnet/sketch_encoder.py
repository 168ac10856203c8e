"""The encoder of sketches: 8 convolutions and 3 downsamplings, from a picture to 44 numbers."""

import torch
from torch import Tensor, nn

EMBEDDING = 44
"""Numbers that stand for a sketch, as in the paper."""
CHANNELS = 3
"""Colours of a picture."""
_GIVEN = 3 * CHANNELS
"""The colours, and each times the place to the right and downwards: their means give the place of ink."""
_FAINT = 1e-3
"""Mean ink of a picture that counts as hardly any."""
_WIDTHS = (16, 24, 32, 48)
"""Channels at each scale. The paper gives the number of convolutions, not their widths."""
_SHARES = (4, 8, 16, 16)
"""Numbers to which each scale is projected; 44 together. Coarser scales say more of where things are."""
_SIDES = (1, 2, 4, 4)
"""Cells along each side in which the means of a scale are taken: without places left and right look
alike."""


class SketchEncoder(nn.Module):
    """Projects the features of each of four scales, and joins them.

    There are two convolutions at each scale and a downsampling by 2 before each scale but the first. Initial
    weights keep the size of the features from layer to layer; with torch's own, what thin lines say would be
    a thousandth after eight convolutions.
    """

    def __init__(self) -> None:
        super().__init__()
        before = (_GIVEN, *_WIDTHS[:-1])
        self.scales = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(inputs, width, 3, padding=1), nn.SiLU(),
                nn.Conv2d(width, width, 3, padding=1), nn.SiLU(),
            )
            for inputs, width in zip(before, _WIDTHS, strict=True)
        )  # fmt: skip
        self.projections = nn.ModuleList(
            nn.Linear(width * side**2, share)
            for width, side, share in zip(_WIDTHS, _SIDES, _SHARES, strict=True)
        )
        for part in self.scales.modules():
            if isinstance(part, nn.Conv2d):
                nn.init.kaiming_normal_(part.weight, nonlinearity="relu")
                nn.init.zeros_(part.bias)  # type: ignore[arg-type]

    def forward(self, pictures: Tensor) -> Tensor:
        """Return (B, 44) of pictures (B, 3, H, H) with values in [0, 1], 0 where there is no ink.

        H is a multiple of 32, so that the coarsest scale divides into 4 by 4 cells.
        """
        # Lines are thin: in means over a picture they would say a hundredth of what a node's own features do.
        pictures = pictures / (pictures.mean(dim=(1, 2, 3), keepdim=True) + _FAINT)
        along = torch.linspace(-1.0, 1.0, pictures.shape[-1], device=pictures.device)
        found, x = [], torch.cat([pictures, pictures * along, pictures * along.unsqueeze(-1)], dim=1)
        for index, (scale, project) in enumerate(zip(self.scales, self.projections, strict=True)):
            x = scale(nn.functional.avg_pool2d(x, 2) if index else x)
            cell = x.shape[-1] // _SIDES[index]
            found.append(project(nn.functional.avg_pool2d(x, cell).flatten(1)))
        return torch.cat(found, dim=1)
