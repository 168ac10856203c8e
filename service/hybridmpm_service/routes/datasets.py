"""Route of data sets: a job makes them."""

import asyncio
from pathlib import Path

from fastapi import APIRouter, Response

from hybridmpm.data.hdf5 import h5py
from hybridmpm_service.http.datasets import MakeDataSet
from hybridmpm_service.http.jobs import JobBody
from hybridmpm_service.jobs.datasets import made
from hybridmpm_service.jobs.job import Progress, Result
from hybridmpm_service.routes.handling.calls import SessionRoute
from hybridmpm_service.routes.handling.dependencies import Jobs, Limits, problems

router = APIRouter(prefix="/v1/datasets", tags=["jobs"], route_class=SessionRoute)


@router.post("", status_code=202, responses=problems(413, 415, 422, 503))
async def make_dataset(body: MakeDataSet, jobs: Jobs, limits: Limits, response: Response) -> JobBody:
    """Begin a job that makes a data set: a zip file of HDF5 files and their metadata.

    Data sets are made one after the other, each by one thread.
    """
    h5py()
    recipe, seeds = await asyncio.to_thread(body.planned, limits)

    async def work(progress: Progress, folder: Path) -> Result:
        return await made(jobs.pool, recipe, seeds, progress, folder)

    job = JobBody.of(jobs.begin("dataset", None, work))
    response.headers["Location"] = job.links["self"]
    return job
