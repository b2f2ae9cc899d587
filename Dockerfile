# ftc-sitl with all extras, its dependencies as locked in requirements.txt: gcs, sitl-plant, ftc-autopilot.
# docs/how-to/several-hosts.md says how a fleet of containers is started.

FROM python:3.12-slim AS build
WORKDIR /source
COPY . .
# requirements.txt locks more than the package needs, so its versions only constrain what pip takes
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /dist . \
    && sed -n 's/^\([^ #].*\) \\$/\1/p' requirements.txt > /dist/constraints.txt

FROM python:3.12-slim
COPY --from=build /dist /dist
RUN pip install --no-cache-dir --constraint /dist/constraints.txt "$(echo /dist/*.whl)[compile,export,foxglove,jsbsim,lab,python,tools,web]" \
    && useradd --create-home --uid 1000 pilot \
    && mkdir /cache /fleet /flights \
    && chown 1000 /cache /fleet /flights
# compiled code lies in the image; a processor that it is not made for compiles its own
ENV XDG_CACHE_HOME=/cache
USER 1000
RUN gcs fly paper/scenario1 --in-process --set duration_s=0.02 --quiet --out /tmp/first \
    && rm -r /tmp/first
WORKDIR /flights
CMD ["gcs", "--help"]
