"""Arguments of the commands about jobs and workers of the service."""

from __future__ import annotations

from typing import Any

from client.arguments.common import OF_ONE, WATCH, as_json, dependents, group, remote


def add(verbs: Any) -> None:
    """Adds the commands."""
    job = group(verbs.add_parser("job", help="list, show, follow, cancel, retry and delete jobs of the service"))
    ls = job.add_parser("ls", parents=[remote(), as_json()], help="list jobs, newest first")
    ls.add_argument("--state", help="list only jobs in this state: queued, running, succeeded, failed, cancelled and others")
    ls.add_argument("--scene", help="list only the jobs of this scene")
    ls.add_argument("--label", metavar="NAME=VALUE", action="append", default=[], help="list only the jobs with this label")
    ls.add_argument("--search", metavar="TEXT", help="list only the jobs whose id, reason, labels or scene mention this")
    ls.add_argument("--most", type=int, default=50, metavar="N", help="list at most N jobs; default 50")
    ls.set_defaults(run="client.jobs:job_ls")
    for verb, about in (
        ("show", "show a job and its regions"),
        ("follow", "print the events of a job until it has ended"),
        ("cancel", "ask a job to end; regions that it has certified remain"),
        ("retry", "run a job again that failed or was cancelled"),
    ):
        of_one = job.add_parser(verb, parents=[remote(), as_json()], help=about)
        of_one.add_argument("job", metavar="ID", help=OF_ONE)
        if verb == "follow":
            of_one.add_argument("--watch", action="store_true", help=WATCH)
        of_one.set_defaults(run=f"client.jobs:job_{verb}")

    mapped = job.add_parser("map", parents=[remote(), as_json()], help="write the map that a job has grown")
    mapped.add_argument("job", metavar="ID", help=OF_ONE)
    mapped.add_argument("--out", metavar="FILE", help="new file for the map; default: one in this directory, named after scene and map")
    mapped.add_argument("--free-set", metavar="FILE", help="new file for the map's free set; default: none")
    mapped.set_defaults(run="client.map:of_job")

    told = job.add_parser("webhook", parents=[remote(), as_json()], help="show the calls to a job's webhook and their results")
    told.add_argument("job", metavar="ID", help=OF_ONE)
    told.add_argument("--resend", action="store_true", help="call the webhook again")
    told.set_defaults(run="client.jobs:job_webhook")
    hooks = job.add_parser(
        "webhooks", parents=[remote(), as_json()], help="list the webhooks that jobs call when they end, with the state of each call"
    )
    hooks.add_argument("--state", choices=["waiting", "delivered", "failed"], help="list only those in this state")
    hooks.set_defaults(run="client.jobs:job_webhooks")
    gone = job.add_parser("rm", parents=[remote(), dependents()], help="delete a job that has ended")
    gone.add_argument("job", metavar="ID", help=OF_ONE)
    gone.set_defaults(run="client.removal:job_rm")

    worker = group(verbs.add_parser("worker", help="list, show, pause, resume and drain workers of the service"))
    worker.add_parser("ls", parents=[remote(), as_json()], help="list the live workers and what each is doing").set_defaults(
        run="client.workers:ls"
    )
    for verb, about in (
        ("show", "show a worker and what each of its processes is doing"),
        ("pause", "let a worker finish its work and take no more"),
        ("resume", "let a paused worker take work again"),
        ("drain", "let a worker finish its work and end; its supervisor may start another, but `ciris up` does not"),
    ):
        of_one = worker.add_parser(verb, parents=[remote(), as_json()], help=about)
        of_one.add_argument("worker", metavar="ID", help=OF_ONE)
        of_one.set_defaults(run=f"client.workers:{verb}")
