# ftc-sitl with all extras, its dependencies as locked in requirements.txt: gcs, sitl-plant, ftc-autopilot.
# docs/how-to/several-hosts.md says how a fleet of containers is started.

FROM python:3.13-slim AS build
WORKDIR /source
# requirements.txt locks more than the package needs, so its versions only constrain what pip takes
COPY requirements.txt .
RUN sed -n 's/^\([^ #].*\) \\$/\1/p' requirements.txt > /constraints.txt
COPY . .
RUN FTC_SITL_MACHINE_CODE=1 pip wheel --no-cache-dir --no-deps --wheel-dir /dist .

FROM python:3.13-slim
COPY --from=build /dist /dist
COPY --from=build /constraints.txt /dist
RUN pip install --no-cache-dir --constraint /dist/constraints.txt "$(echo /dist/*.whl)[compile,export,foxglove,jsbsim,lab,logs,python,tools,web]" \
    && useradd --create-home --uid 1000 pilot \
    && mkdir /cache /fleet /flights \
    && chown 1000 /cache /fleet /flights
# for laws of compiled Python; all else is machine code in the wheel
ENV XDG_CACHE_HOME=/cache
USER 1000
WORKDIR /flights
CMD ["gcs", "--help"]
