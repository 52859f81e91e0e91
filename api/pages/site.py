"""The pages and their static files are added to the routes of the application here."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import HTMLResponse

from api.access import READ
from api.pages import comparison, form, home, inventory, job, project, reading, region, scene, workers
from api.pages.assets import Assets
from api.pages.rendering import ROOT


def install(routes: APIRouter) -> None:
    """Adds the pages and their static files to the routes."""
    pages = APIRouter(include_in_schema=False, default_response_class=HTMLResponse, dependencies=[READ])
    for part in (comparison, form, home, inventory, job, project, reading, region, scene, workers):
        pages.include_router(part.router)
    routes.include_router(pages)
    routes.mount("/static", Assets(directory=ROOT / "static"), name="static")
