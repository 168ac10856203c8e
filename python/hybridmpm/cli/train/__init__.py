"""`hybridmpm train ...`: train networks on data, which are made from seeds where missing."""

import click

from hybridmpm._support import signals
from hybridmpm.cli.train.control import control
from hybridmpm.cli.train.controlnet import controlnet
from hybridmpm.cli.train.physics import physics

__all__ = ["train"]


@click.group()
@click.pass_context
def train(ctx: click.Context) -> None:
    """Train networks. This needs torch: pip install 'hybridmpm[train]'."""
    ctx.with_resource(signals.raising_at_end())


train.add_command(control)
train.add_command(controlnet)
train.add_command(physics)
