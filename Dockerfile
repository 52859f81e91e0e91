# One image for every role: migrate, api, control worker, solve worker (docker-compose.yml says which command is which).
FROM python:3.12.14-slim-bookworm@sha256:782412e85d0f0984994c290652577d4018aff08145c85b262bb63dc0c7522254 AS build
WORKDIR /src
RUN python -m venv /venv
COPY requirements/runtime.lock requirements/
RUN /venv/bin/pip install --no-cache-dir --no-deps --require-hashes --requirement requirements/runtime.lock
COPY pyproject.toml README.md ./
COPY certifier certifier
COPY db db
COPY planner planner
COPY jobs jobs
COPY workers workers
COPY dashboard dashboard
COPY api api
COPY ciris ciris
COPY client client
RUN /venv/bin/pip install --no-cache-dir --no-deps --no-build-isolation .

FROM python:3.12.14-slim-bookworm@sha256:782412e85d0f0984994c290652577d4018aff08145c85b262bb63dc0c7522254
# Drake needs glib. A worker must not be process 1: its children take an init as their parent for a dead worker.
# The base image is one of a digest, and an old version of a package leaves Debian's mirrors.
# hadolint ignore=DL3008
RUN apt-get update && apt-get install --yes --no-install-recommends libglib2.0-0 tini && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home --uid 10001 ciris
COPY --from=build /venv /venv
ENV PATH=/venv/bin:$PATH PYTHONUNBUFFERED=1 CIRIS_KERNELS=/venv/kernels
# What jobs call is compiled here, for processors like this machine's. Workers compile it again on others.
RUN NUMBA_CACHE_DIR=$CIRIS_KERNELS python -m jobs.kernels
COPY --chmod=755 deploy/entry /usr/local/bin/ciris-entry
# All but /tmp may be read-only.
ENV NUMBA_CACHE_DIR=/tmp/numba
USER 10001
WORKDIR /home/ciris
ENTRYPOINT ["tini", "--", "ciris-entry"]
CMD ["python", "-m", "api"]
