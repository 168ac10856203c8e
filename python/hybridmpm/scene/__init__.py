"""Scenes: bodies, obstacles, openings and materials in a box, and the particles that fill them."""

from hybridmpm.scene import plain_data
from hybridmpm.scene.bodies import Ball, Body, Box, Cylinder, Mesh, Polygon
from hybridmpm.scene.facets import Triangles, Vertices
from hybridmpm.scene.files import shape_in
from hybridmpm.scene.materials import LIQUIDS, Elastic, Fluid, Liquid, Material, Sand, Water
from hybridmpm.scene.motion import Motion
from hybridmpm.scene.obstacles import (
    BallObstacle,
    BoxObstacle,
    CylinderObstacle,
    HalfSpaceObstacle,
    MeshObstacle,
    Obstacle,
    PolygonObstacle,
    SegmentObstacle,
)
from hybridmpm.scene.openings import (
    BallSink,
    BoxSink,
    Emitter,
    ParticleLimitWarning,
    RectangularEmitter,
    RoundEmitter,
    Sink,
)
from hybridmpm.scene.rigid import RigidBall, RigidBody, RigidBox, RigidCylinder, RigidHull
from hybridmpm.scene.sampling import Particles
from hybridmpm.scene.scene import Scene
from hybridmpm.scene.walls import Wall, WallFaces, Walls
from hybridmpm.scene.world import World

__all__ = [
    "LIQUIDS",
    "Ball",
    "BallObstacle",
    "BallSink",
    "Body",
    "Box",
    "BoxObstacle",
    "BoxSink",
    "Cylinder",
    "CylinderObstacle",
    "Elastic",
    "Emitter",
    "Fluid",
    "HalfSpaceObstacle",
    "Liquid",
    "Material",
    "Mesh",
    "MeshObstacle",
    "Motion",
    "Obstacle",
    "ParticleLimitWarning",
    "Particles",
    "Polygon",
    "PolygonObstacle",
    "RectangularEmitter",
    "RigidBall",
    "RigidBody",
    "RigidBox",
    "RigidCylinder",
    "RigidHull",
    "RoundEmitter",
    "Sand",
    "Scene",
    "SegmentObstacle",
    "Sink",
    "Triangles",
    "Vertices",
    "Wall",
    "WallFaces",
    "Walls",
    "Water",
    "World",
    "plain_data",
    "shape_in",
]
