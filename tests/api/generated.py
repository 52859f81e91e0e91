"""What somebody does with a client that was generated from the OpenAPI document: submits a job, follows it, and fetches the region.

Arguments: the directory of the generated package, the service's address, the zip of a scene.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path


def main(directory: str, url: str, bundle: str) -> None:
    sys.path.insert(0, directory)
    from ciris_client import Client
    from ciris_client.api.jobs import create_job, get_job, list_job_events
    from ciris_client.api.planning import contains
    from ciris_client.api.regions import download_region_proof, get_region, list_regions, verify_region
    from ciris_client.api.scenes import create_scene, get_scene
    from ciris_client.models import AcceptedJob, BodyCreateScene, ContainsRequest, GrowOptions, GrowRequest, JobState, Problem, Seed
    from ciris_client.types import File

    client = Client(base_url=url)
    with Path(bundle).open("rb") as file:
        scene = create_scene.sync(client=client, body=BodyCreateScene(bundle=File(file, "scene.zip", "application/zip")))
    unknown = get_scene.sync(client=client, scene_id="no-such-scene")
    assert isinstance(unknown, Problem)
    assert unknown.code == "scene_not_found"
    request = GrowRequest(kind="grow", scene=scene.id, seed=Seed(q=[0.4, 0.3]), options=GrowOptions(stages=1))
    job = create_job.sync(client=client, body=request)
    assert isinstance(job, AcceptedJob)
    until = time.monotonic() + 120
    while not job.ended and time.monotonic() < until:
        time.sleep(0.2)
        job = get_job.sync(client=client, job_id=job.id)
    assert job.state is JobState.SUCCEEDED, job
    kinds = {event.kind for event in list_job_events.sync(client=client, job_id=job.id).events}
    assert {"job", "iteration", "pairs", "region"} <= kinds
    region = get_region.sync(client=client, region_id=job.region)
    assert region.id in [one.id for one in list_regions.sync(client=client, scene=scene.name).regions]
    assert region.manifest["space"]["kind"] == "tangent"
    assert verify_region.sync(client=client, region_id=region.id).holds
    proof = download_region_proof.sync_detailed(client=client, region_id=region.id)
    assert len(proof.content) > 1000
    answer = contains.sync(client=client, body=ContainsRequest(scene=scene.id, q=[[0.4, 0.3]]))
    assert answer.points[0].inside
    print(region.id)


if __name__ == "__main__":
    main(*sys.argv[1:])
