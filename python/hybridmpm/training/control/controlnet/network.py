"""The Fluid ControlNet of the paper: diffusion over the external acceleration of the particles."""

import math

import torch
from torch import Tensor, nn

from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training.control.controlnet.sketch_encoder import EMBEDDING, SketchEncoder
from hybridmpm.training.physics.network.edges import Edges
from hybridmpm.training.physics.network.graph_network import Decoder, Encoder, Layer

STEP_EMBEDDING = 16
"""Numbers that stand for the control step, as in the paper."""
MOMENTS = 6
"""Numbers that describe the place of the ink of a sketch."""
TIME_EMBEDDING = 64
"""Numbers that stand for the time of the diffusion."""
_LONGEST_WAVE = 10_000.0


class FluidControlNet(nn.Module):
    """The simulator's graph network, conditioned on a sketch: it predicts a clean field from a noisy one.

    Each node gets, besides its features, its place in the box, an embedding of the control step, and the
    noisy acceleration, into which the control step is embedded, too. The embeddings of sketch and diffusion
    time are joined, and shift and scale the nodes before each layer of the processor, as in DiT (Peebles and
    Xie, arXiv:2212.09748).

    Unlike in the paper, each node also gets the position of the middle of the ink relative to it and the
    spread of the ink, and the same of the fluid, with its mean velocity. From the embedding and its
    neighbours alone it would learn these slowly.

    Parameters
    ----------
    spec : NetworkSpec
        Size, radius and scenarios; r_p below 1 makes it a network on coarse control nodes.
    """

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.spec = spec
        condition = EMBEDDING + TIME_EMBEDDING + MOMENTS
        self.sketch = SketchEncoder()
        self.control_step = nn.Sequential(
            nn.Linear(1, STEP_EMBEDDING), nn.SiLU(), nn.Linear(STEP_EMBEDDING, STEP_EMBEDDING)
        )
        self.in_noise = nn.Linear(STEP_EMBEDDING, spec.dim, bias=False)
        self.encoder = Encoder(spec, STEP_EMBEDDING + 5 * spec.dim + MOMENTS)
        self.layers = nn.ModuleList(Layer(spec) for _ in range(spec.layers))
        self.modulations = nn.ModuleList(_modulation(condition, spec.latent) for _ in range(spec.layers))
        self.decoder = Decoder(spec)

    def embedded(self, noisy: Tensor, step: Tensor) -> Tensor:
        """Return a noisy field (N, D), at first noise alone, with the control step embedded into it.

        Parameters
        ----------
        noisy : (N, D)
        step : (N, 1)
            Control step of each node's graph over the number of steps, in [0, 1].
        """
        return noisy + self.in_noise(self.control_step(step))  # type: ignore[no-any-return]

    def condition(self, pictures: Tensor, time: Tensor) -> Tensor:
        """Return the condition (B, 114) of pictures (B, 3, H, H) and diffusion times (B,) in [1, 1000]."""
        return torch.cat([self.sketch(pictures), waves(time), ink_moments(pictures)], dim=-1)

    def forward(
        self,
        nodes: Tensor,
        types: Tensor,
        edges: Tensor,
        graph: Edges,
        *,
        places: Tensor,
        fluid: Tensor,
        noisy: Tensor,
        step: Tensor,
        condition: Tensor,
    ) -> Tensor:
        """Return the clean field x_0 (N, D), accelerations over their standard deviation.

        Parameters
        ----------
        nodes : (N, F)
            Features of the nodes without the type, as `node_features` gives them.
        types : int64 (N,)
            DeepMind's particle types.
        edges : (..., D + 1)
            Features of the edges.
        graph : Edges
            Pairs of neighbours.
        places : (N, D)
            Places of the nodes in the box, from -1 to 1. The features of the simulator do not contain them,
            and a sketch has no meaning without a place.
        fluid : (N, 3 D)
            From `fluid_moments`.
        noisy : (N, D)
            The noisy field x_t.
        step : (N, 1)
            As in `embedded`.
        condition : (N, 114) or (1, 114)
            From `condition`, for the graph of each node, or for the only graph.
        """
        noisy = self.embedded(noisy, step)
        # A sum with zeros: the length of an expanded array would be fixed when the network is exported.
        ink = condition[..., -MOMENTS:] + torch.zeros_like(places[:, :1])
        seen = torch.cat([ink[:, :2] - places[:, :2], ink[:, 2:]], dim=-1)
        given = torch.cat([nodes, places, seen, fluid, self.control_step(step), noisy], dim=-1)
        nodes, edges = self.encoder(given, types, edges)
        for layer, modulation in zip(self.layers, self.modulations, strict=True):
            scale, shift = modulation(condition).chunk(2, dim=-1)
            nodes, edges = layer(nodes * (1 + scale) + shift, edges, graph)
        return self.decoder(nodes)  # type: ignore[no-any-return]


def ink_moments(pictures: Tensor) -> Tensor:
    """Return where the ink of pictures (B, 3, H, H) is (B, 6), in coordinates of the front view from -1 to 1.

    The middle to the right and upwards, the standard deviations along both and their correlation, and the
    share of red light in what the ink takes from white: little for a red arrow, more for a green oval.
    """
    side = pictures.shape[-1]
    along = (torch.arange(side, device=pictures.device) + 0.5) * (2.0 / side) - 1.0
    ink = pictures.sum(dim=1)
    total = ink.sum(dim=(1, 2)) + 1e-6
    right, up = ink.sum(dim=1) / total[:, None], ink.sum(dim=2).flip(-1) / total[:, None]
    x, y = (right * along).sum(dim=1), (up * along).sum(dim=1)
    squares = [(share * (along - middle[:, None]) ** 2).sum(dim=1) for share, middle in ((right, x), (up, y))]
    a, b = ((square + 1e-6).sqrt() for square in squares)
    product = (ink * along.flip(-1)[:, None] * along).sum(dim=(1, 2)) / total - x * y
    return torch.stack([x, y, a, b, product / (a * b), pictures[:, 0].sum(dim=(1, 2)) / total], dim=-1)


def fluid_moments(places: Tensor, v: Tensor, of_graph: Tensor | None = None) -> Tensor:
    """Return the inputs of each node about the whole fluid (N, 3 D).

    Where its middle is, seen from the node, its standard deviations along the axes, and its mean velocity.

    Parameters
    ----------
    places, v : (N, D)
        Places and velocities of the nodes.
    of_graph : int64 (N,), optional
        Graph of each node; one graph if absent.
    """
    dim = places.shape[1]
    parts = torch.cat([places, places.square(), v], dim=1)
    if of_graph is None:
        means = parts.mean(dim=0, keepdim=True) + torch.zeros_like(parts)
    else:
        graphs = int(of_graph[-1]) + 1
        total = torch.zeros(graphs, parts.shape[1], dtype=parts.dtype).index_add(0, of_graph, parts)
        means = (total / torch.bincount(of_graph, minlength=graphs)[:, None])[of_graph]
    middle, square, velocity = (means[:, first : first + dim] for first in (0, dim, 2 * dim))
    return torch.cat([middle - places, (square - middle.square()).clamp(min=1e-6).sqrt(), velocity], dim=1)


def waves(time: Tensor) -> Tensor:
    """Return sines and cosines (B, 64) of diffusion times (B,), of wavelengths from 2 pi to 2 pi 10^4.

    References
    ----------
    Vaswani et al., arXiv:1706.03762, section 3.5, with the time of the diffusion as the position.
    """
    half = TIME_EMBEDDING // 2
    rates = torch.exp(-math.log(_LONGEST_WAVE) / half * torch.arange(half, device=time.device))
    angles = time.to(torch.float32).unsqueeze(-1) * rates
    return torch.cat([angles.sin(), angles.cos()], dim=-1)


def _modulation(inputs: int, width: int) -> nn.Module:
    """Return a map to scale and shift that begins as zero, so that training begins without a condition."""
    last = nn.Linear(width, 2 * width)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(inputs, width), nn.SiLU(), last)
