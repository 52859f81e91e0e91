"""The pages and their static files are added to the application here."""

from __future__ import annotations

from fastapi import APIRouter, FastAPI
from fastapi.responses import HTMLResponse

from api.access import READ
from api.pages import comparison, form, home, inventory, job, project, region, scene, workers
from api.pages.assets import Assets
from api.pages.rendering import ROOT


def install(app: FastAPI) -> None:
    """Adds the pages and their static files to the application."""
    pages = APIRouter(include_in_schema=False, default_response_class=HTMLResponse, dependencies=[READ])
    for part in (comparison, form, home, inventory, job, project, region, scene, workers):
        pages.include_router(part.router)
    app.include_router(pages)
    app.mount("/static", Assets(directory=ROOT / "static"), name="static")
