"""What clients send to have a data set made."""

from pydantic import ConfigDict, Field

from hybridmpm.data import Recipe, Seeds
from hybridmpm.errors import ConfigError, UnknownScenarioError
from hybridmpm.scenarios import NAMES
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.requests import FrameCount, Request
from hybridmpm_service.settings import Settings

MOST_TRAJECTORIES = 1000
MOST_NUMBERS = 1 << 27
"""Largest number of coordinates in a data set, all states of all trajectories together: 512 MiB."""


class MakeDataSet(Request):
    """A data set of trajectories of a scenario; a trajectory depends on these settings and its seed alone."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"scenario": "water_2d", "trajectories": 2, "frames": 100}]}
    )

    scenario: str = Field(
        max_length=100, description=f"Scenario that the scenes are drawn from: one of {', '.join(NAMES)}."
    )
    trajectories: int = Field(
        ge=0, le=MOST_TRAJECTORIES, strict=True, description="Number of trajectories for training."
    )
    valid: int = Field(
        default=0, ge=0, le=MOST_TRAJECTORIES, strict=True, description="Number of them for validation."
    )
    test: int = Field(
        default=0, ge=0, le=MOST_TRAJECTORIES, strict=True, description="Number of them for tests."
    )
    seed: int = Field(
        default=0,
        ge=0,
        lt=2**31,
        strict=True,
        description="First seed of each split, counted from the start of the split's seeds.",
    )
    frames: FrameCount | None = Field(
        default=None,
        description="Number of frames of a trajectory; that of the scenario if absent. All trajectories have "
        "at most as many as the setting max_dataset_frames says.",
    )
    stride: FrameCount = Field(default=1, description="Number of frames from one stored state to the next.")
    r_p: float = Field(default=1.0, gt=0, le=1, description="Number of particles over that of the scene.")

    def planned(self, limits: Settings) -> tuple[Recipe, Seeds]:
        """Return the recipe and the seeds.

        Raises
        ------
        FieldError
            A setting is out of range, or the data set is larger than this server makes.
        """
        try:
            seeds = Seeds(train=self.trajectories, valid=self.valid, test=self.test, first=self.seed)
            recipe = Recipe(scenario=self.scenario, frames=self.frames, stride=self.stride, r_p=self.r_p)
            particles = len(recipe.scene(self.seed).sample().x) * self.r_p
        except UnknownScenarioError as err:
            raise FieldError("body.scenario", str(err).removeprefix("scenario: ")) from None
        except ConfigError as err:
            raise FieldError("body", str(err)) from None
        count = sum(seeds.counts().values())
        frames, most = count * (recipe.states - 1) * recipe.stride, limits.max_dataset_frames
        if frames > most:
            text = f"makes {frames} frames in all, and this server makes at most {most} (max_dataset_frames)"
            raise FieldError("body.trajectories", text)
        numbers = round(count * recipe.states * particles * recipe.scene(self.seed).dim)
        if numbers > MOST_NUMBERS:
            text = f"must be at least {-(-self.stride * numbers // MOST_NUMBERS)} for so many frames"
            raise FieldError("body.stride", f"{text}, got {self.stride}")
        return recipe, seeds
