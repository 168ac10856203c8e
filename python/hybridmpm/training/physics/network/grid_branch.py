"""`GridBranch`: what lies farther than the graph reaches, by convolutions on a coarse grid.

After CoRGI (arXiv:2511.22938): the latents of the nodes are projected onto a grid, convolved there, and read
back at the nodes. A layer of message passing reaches one radius; the convolutions reach eight cells at once,
so a node learns of the flow around it, of walls and of the weight of the matter above.
"""

import torch
from torch import Tensor, nn

from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training.physics.network.edges import Edges

CHANNELS = 16
"""Numbers of a cell besides its number of nodes."""
_DILATIONS = (1, 2, 4)
"""Dilations of the convolutions, whose kernels have three cells along each axis."""
_FEW = 0.5
"""Number of nodes that is added to those of a cell before their sum is divided by it."""


class GridBranch(nn.Module):
    """An update of the latents of nodes that comes through a grid over the unit box.

    Nodes count for the nearest cells with linear weights. These are products of one weight for each axis, so
    both ways are products of matrices: nothing is scattered, and onnxruntime is quick. The last map begins at
    zero, so that an untrained branch changes nothing.

    Parameters
    ----------
    spec : NetworkSpec
        With `grid_cells` above 0.
    """

    _indices: Tensor

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self._dim, self._cells = spec.dim, spec.grid_cells
        self.register_buffer("_indices", torch.arange(float(spec.grid_cells)), persistent=False)
        convolution = nn.Conv2d if spec.dim == 2 else nn.Conv3d
        self.down = nn.Linear(spec.latent, CHANNELS)
        layers: list[nn.Module] = []
        for number, dilation in enumerate(_DILATIONS):
            inputs = CHANNELS + 1 if number == 0 else CHANNELS
            layers += [convolution(inputs, CHANNELS, 3, padding=dilation, dilation=dilation), nn.ReLU()]
        self.convolutions = nn.Sequential(*layers)
        self.up = nn.Linear(CHANNELS, spec.latent)
        nn.init.zeros_(self.up.weight)
        nn.init.zeros_(self.up.bias)

    def forward(self, latents: Tensor, x: Tensor, graph: Edges) -> Tensor:
        """Return the update (N, H) of latents (N, H) of nodes at x (N, D) [m]."""
        weights = [self._weights(one) for one in graph.split(x.detach())]
        values = graph.split(self.down(latents))
        grids = self.convolutions(
            torch.stack([self._onto(one, *pair) for one, pair in zip(values, weights, strict=True)])
        )
        back = [self._from(grids[number], *pair) for number, pair in enumerate(weights)]
        return self.up(torch.cat(back))  # type: ignore[no-any-return]

    def _weights(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the weights (N, n) of nodes at x (N, D) along the last axis, and (N, M) along all others."""
        places = torch.clamp(x * self._cells - 0.5, 0.0, self._cells - 1.0)
        hats = torch.relu(1.0 - torch.abs(places.unsqueeze(-1) - self._indices))
        rest = hats[:, 0]
        for axis in range(1, self._dim - 1):
            rest = (rest.unsqueeze(2) * hats[:, axis].unsqueeze(1)).flatten(1)
        return hats[:, -1], rest

    def _onto(self, values: Tensor, last: Tensor, rest: Tensor) -> Tensor:
        """Return the mean of values (N, C) and the number of nodes in each cell, (C + 1, n, ..)."""
        shape = [self._cells] * self._dim
        count = (rest.transpose(0, 1) @ last).reshape(*shape, 1)
        spread = (last.unsqueeze(2) * values.unsqueeze(1)).flatten(1)
        sums = (rest.transpose(0, 1) @ spread).reshape(*shape, CHANNELS)
        return torch.cat([sums / (count + _FEW), count], dim=-1).movedim(-1, 0)

    def _from(self, grid: Tensor, last: Tensor, rest: Tensor) -> Tensor:
        """Return the mean (N, C) of the cells around each node of a grid (C, n, ..)."""
        cells, channels = self._cells, grid.shape[0]
        rows = rest @ grid.movedim(0, -1).reshape(-1, cells * channels)
        return (last.unsqueeze(2) * rows.reshape(-1, cells, channels)).sum(1)
