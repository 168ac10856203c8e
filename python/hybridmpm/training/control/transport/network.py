"""The transport network: a U-Net over the planes of a state, and a perceptron for each particle."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from hybridmpm.control.methods.learned.features import PLANES, channels, numbers, of_particle
from hybridmpm.control.methods.learned.spec import CELLS, TransportSpec

_EMBEDDING = 64
"""Numbers that stand for the whole: state, sketch and time of the flow."""
_MIDDLE = {2: 128, 3: 64}
"""Width of the layer between what is found on the coarsest cells and that, by dimension."""
_HIDDEN = 96
"""Width of the perceptron of a particle; its first layer is half as wide again in 3D."""
_GROUPS = 4


class TransportNetwork(nn.Module):
    """From a state, a sketch and places that are noise to some degree, to the places at the end.

    One U-Net of two dimensions reads each plane of the state; an embedding says which of them it is. What the
    U-Net finds on the coarsest cells of all planes is joined and given back to each. A particle reads its
    place on all planes.

    It is trained to flow from noise to data: see `TransportTrainer`. At time 0 the places are noise alone.

    Parameters
    ----------
    spec : TransportSpec
    """

    def __init__(self, spec: TransportSpec) -> None:
        super().__init__()
        dim = spec.dim
        self.planes = PLANES[dim]
        fine, middle, coarse = spec.width, 2 * spec.width, 4 * spec.width
        levels = (fine, middle, coarse, coarse)
        smallest = CELLS // 2 ** (len(levels) - 1)
        self.whole = nn.Sequential(
            nn.Linear(numbers(dim) + 2, _EMBEDDING), nn.SiLU(), nn.Linear(_EMBEDDING, _EMBEDDING), nn.SiLU()
        )
        self.plane = nn.Parameter(torch.randn(len(self.planes), _EMBEDDING) / 2)
        seen_on_plane = channels(dim, obstacles=spec.obstacles)
        self.first = nn.Conv2d(seen_on_plane + dim, fine, 3, padding=1)
        inward = zip((fine, *levels), levels, strict=False)
        self.down = nn.ModuleList(_Block(before, after) for before, after in inward)
        self.middle = nn.Sequential(
            nn.Linear(coarse * smallest**2, _MIDDLE[dim]), nn.SiLU(), nn.Linear(_MIDDLE[dim], _EMBEDDING)
        )
        outward = zip(levels[::-1], levels[-2::-1], strict=False)
        self.up = nn.ModuleList(_Block(below + beside, beside) for below, beside in outward)
        seen = len(self.planes) * (fine + coarse)
        hidden = _HIDDEN * dim // 2
        reading = nn.Linear(seen + of_particle(dim) + dim + _EMBEDDING, hidden)
        self.answer = nn.Sequential(
            reading,
            nn.SiLU(),
            nn.Linear(hidden, _HIDDEN),
            nn.SiLU(),
            nn.Linear(_HIDDEN, dim),
        )
        with torch.no_grad():
            for weights in self.answer[-1].parameters():
                weights.zero_()
            # Noise says nothing where it is all there is, so training begins without it.
            self.first.weight[:, seen_on_plane:] = 0.0
            reading.weight[:, seen + of_particle(dim) :][:, :dim] = 0.0

    def forward(  # noqa: PLR0917 - the exporter names inputs by their place
        self, grid: Tensor, numbers: Tensor, particles: Tensor, places: Tensor, noisy: Tensor, time: Tensor
    ) -> Tensor:
        """Return the places (B, P, D) at the end, in the aim's own coordinates.

        Parameters
        ----------
        grid, numbers, particles, places
            As in `hybridmpm.control.methods.learned.features.Inputs`.
        noisy : (B, P, D)
            The places at a time of the flow, in the aim's own coordinates.
        time : (B,)
            Time of the flow, in [0, 1].
        """
        batch, count = particles.shape[:2]
        planes = len(self.planes)
        numbers = torch.cat([numbers, time[:, None], torch.sin(2 * torch.pi * time)[:, None]], dim=-1)
        whole = self.whole(numbers)
        noise = torch.stack([_on_cells(noisy, places[..., axes]) for axes in self.planes], dim=1)
        x = torch.cat([grid.reshape(batch, planes, -1, CELLS, CELLS), noise], dim=2).flatten(0, 1)
        x = self.first(x)
        embedded = (whole[:, None] + self.plane).flatten(0, 1)
        beside = []
        for level, block in enumerate(self.down):
            x = block(functional.avg_pool2d(x, 2) if level else x, embedded)
            beside.append(x)
        found = self.middle(x.flatten(1)).reshape(batch, planes, -1).mean(dim=1)
        whole = whole + found
        embedded = (whole[:, None] + self.plane).flatten(0, 1)
        fields = []
        for block, other in zip(self.up, beside[-2::-1], strict=True):
            x = block(torch.cat([functional.interpolate(x, scale_factor=2.0), other], dim=1), embedded)
            fields.append(x)
        read = [
            _at(field.unflatten(0, (batch, planes))[:, plane], places[..., axes])
            for field in (fields[-1], fields[0])
            for plane, axes in enumerate(self.planes)
        ]
        around = whole[:, None].expand(-1, count, -1)
        return self.answer(torch.cat([*read, particles, noisy, around], dim=-1))  # type: ignore[no-any-return]


class _Block(nn.Module):
    """Two convolutions beside a shortcut; the embedding of the whole scales and shifts what is between."""

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(before, after, 3, padding=1)
        self.second = nn.Conv2d(after, after, 3, padding=1)
        self.first_norm, self.second_norm = nn.GroupNorm(_GROUPS, after), nn.GroupNorm(_GROUPS, after)
        # Before training the block is its shortcut.
        nn.init.zeros_(self.second_norm.weight)
        self.modulation = nn.Linear(_EMBEDDING, 2 * after)
        self.shortcut = nn.Conv2d(before, after, 1) if before != after else nn.Identity()

    def forward(self, x: Tensor, whole: Tensor) -> Tensor:
        scale, shift = self.modulation(whole)[:, :, None, None].chunk(2, dim=1)
        hidden = self.first_norm(self.first(x)) * (1 + scale) + shift
        hidden = self.second_norm(self.second(functional.silu(hidden)))
        return self.shortcut(x) + hidden  # type: ignore[no-any-return]


def _at(field: Tensor, places: Tensor) -> Tensor:
    """Return the values (B, P, C) of a field (B, C, H, W) at places (B, P, 2) from -1 to 1."""
    found = functional.grid_sample(field, places[:, :, None], padding_mode="border", align_corners=False)
    return found[..., 0].transpose(1, 2)


def _on_cells(values: Tensor, places: Tensor) -> Tensor:
    """Return the mean of the values (B, P, D) of particles on the cells of a plane, (B, D, `CELLS`, `CELLS`).

    The cells of the mean are twice as large as those of the plane, so that most of them contain a particle.
    """
    batch, half, dim = len(values), CELLS // 2, values.shape[2]
    at = ((places + 1) / 2 * half).long().clamp(0, half - 1)
    cell = (at[..., 1] * half + at[..., 0])[..., None].expand(-1, -1, dim + 1)
    ones = torch.ones_like(values[..., :1])
    sums = torch.zeros(batch, half * half, dim + 1, dtype=values.dtype, device=values.device)
    sums = sums.scatter_add(1, cell, torch.cat([values, ones], dim=-1))
    mean = sums[..., :dim] / sums[..., dim:].clamp_min(1.0)
    return functional.interpolate(mean.transpose(1, 2).reshape(batch, dim, half, half), scale_factor=2.0)
