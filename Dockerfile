# One image a role, each with what that role needs and no more: a gateway holds no OpenGL. ROLE is one of
# router, gateway, kinematics, simulator, recorder, player, renderer, console, watch, store, foxglove, ros2, keys, all.
#
#   docker build --build-arg ROLE=gateway -t robomesh-gateway .

FROM debian:12 AS base
ENV DEBIAN_FRONTEND=noninteractive PYTHONUNBUFFERED=1
# ca-certificates brings openssl, with which deploy/three-sites/make-keys makes the pages' certificates.
RUN apt-get update -qq \
 && apt-get install -y -qq --no-install-recommends python3 python3-pip ca-certificates libgomp1 \
 && rm -rf /var/lib/apt/lists/*
RUN python3 -m pip install --quiet --root-user-action=ignore --target /opt/uv uv==0.13.8

# The wheel, with the page in it.
FROM base AS wheel
WORKDIR /source
COPY pyproject.toml requirements.lock README.md LICENSE ./
COPY robomesh robomesh
COPY robots robots
COPY controllers controllers
COPY protocol_gateway protocol_gateway
COPY renderer renderer
COPY services services
COPY web web
RUN /opt/uv/bin/uv build --quiet --wheel --build-constraint requirements.lock --out-dir /dist

FROM base AS role
ARG ROLE=all
RUN if [ "$ROLE" = renderer ] || [ "$ROLE" = all ]; then \
      apt-get update -qq \
      && apt-get install -y -qq --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
      && rm -rf /var/lib/apt/lists/*; \
    fi
COPY --from=wheel /dist /dist
COPY requirements.lock /dist/
RUN --mount=type=cache,target=/root/.cache/uv \
    /opt/uv/bin/uv venv --quiet /opt/robomesh \
 && UV_LINK_MODE=copy /opt/uv/bin/uv pip install --quiet --python /opt/robomesh/bin/python \
      --constraint /dist/requirements.lock "$(echo /dist/robomesh-*.whl)[$ROLE]" \
 && case "$ROLE" in gateway|kinematics) \
      /opt/uv/bin/uv pip install --quiet --python /opt/robomesh/bin/python --no-deps \
        --constraint /dist/requirements.lock eaik;; \
    esac \
 && /opt/robomesh/bin/python -m compileall -q /opt/robomesh
# What a role keeps is below /data, each part a volume of its own; everything else may be read-only.
RUN useradd --uid 10001 --create-home robomesh \
 && mkdir -p /data/audit /data/recordings /data/robots /data/watch /data/programs /data/cache && chown -R robomesh /data
ENV PATH=/opt/robomesh/bin:$PATH XDG_CACHE_HOME=/data/cache
USER 10001
WORKDIR /data
ENTRYPOINT ["/opt/robomesh/bin/robomesh"]
