# Runs the program as a user without rights:
#   docker build -t truenorth .
#   docker run --rm -v "$PWD:/data" truenorth align log.csv --lat 48.1 --imu navigation -o result
FROM python:3.12-slim AS build
WORKDIR /src
COPY pyproject.toml README.md LICENSE ./
COPY truenorth truenorth
RUN python -m venv /opt/truenorth \
 && /opt/truenorth/bin/pip install --no-cache-dir --no-compile . \
 && find /opt/truenorth -name tests -type d -prune -exec rm -rf {} +

FROM python:3.12-slim
COPY --from=build /opt/truenorth /opt/truenorth
# Compiled kernels and bytecode are kept in the image: the first alignment of a container starts at once.
ENV PATH=/opt/truenorth/bin:$PATH PYTHONUNBUFFERED=1 NUMBA_CACHE_DIR=/var/cache/truenorth MPLCONFIGDIR=/tmp
RUN useradd --create-home --uid 1000 navigator \
 && mkdir -p /data /var/cache/truenorth \
 && chown navigator /data /var/cache/truenorth \
 && python -m compileall -q /opt/truenorth/lib
USER navigator
# The user's own folder: one that WORKDIR made would be root's.
WORKDIR /home/navigator
RUN truenorth simulate static_kalman --no-plot --csv -o run \
 && truenorth align run/imu.csv --lat 45 --imu navigation -o result \
 && rm -r run result
WORKDIR /data
ENTRYPOINT ["truenorth"]
CMD ["--help"]
