# Two targets from one base: `service` answers HTTP, `worker` computes. Neither installs torch.
FROM python:3.11-slim-bookworm AS base
ENV PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
# Optional parts: --build-arg EXTRAS="s3 telemetry"
ARG EXTRAS=""
# What the environment is made of; a worker with a GPU: --build-arg LOCK=cuda
ARG LOCK=service
WORKDIR /app
COPY requirements requirements
RUN pip install -r "requirements/${LOCK}.txt" \
    && for extra in ${EXTRAS}; do pip install -r "requirements/${extra}.txt" || exit 1; done
COPY clients clients
RUN pip install --no-deps ./clients/python && useradd --create-home --uid 10001 dlo \
    && mkdir /data && chown dlo /data
COPY workers workers
ENV DLO_DATA_DIR=/data
VOLUME /data

FROM base AS worker
COPY models models
# The root is read-only: without this every child compiles all modules again before it loads the networks.
RUN python -m compileall -q .
USER 10001
CMD ["python", "-m", "workers"]

FROM base AS service
COPY services services
RUN python -m compileall -q .
USER 10001
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=20s \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/healthz', timeout=2)"]
# The settings refuse a host that is not loopback unless there are API keys.
ENV DLO_HOST=0.0.0.0
CMD ["uvicorn", "--factory", "services.app:create_app", "--host", "0.0.0.0", "--port", "8000", \
     "--http", "services.http_protocol:BoundedHttp", "--ws-max-size", "33554432", \
     "--no-access-log"]
