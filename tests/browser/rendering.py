"""The plant's moving arm, rendered."""

import asyncio
from contextlib import contextmanager

import pytest

from renderer import service
from renderer.errors import NoEncoderError, NoOpenGLError
from tests.renderer.renderer_site import shared_shapes


@contextmanager
def rendering(plant, folder, **settings):
    """Run a renderer in the plant's thread while the block runs; skip if it cannot draw."""

    async def start():
        chosen = service.Settings(site="hall", robots=("pt600",), folder=shared_shapes(folder), **settings)
        task = plant.loop.create_task(service.serve(plant.session, chosen))
        await asyncio.wait([task], timeout=1.0)
        if task.done():
            task.result()
        return task

    async def end(task):
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    try:
        task = plant.call(start())
    except (NoOpenGLError, NoEncoderError) as error:
        pytest.skip(f"nothing is rendered here: {error}")
    try:
        yield
    finally:
        plant.call(end(task))
