# plan-replay without ROS: docker build -t plan-replay . ; then, where logs and plans lie:
# docker run --rm -v "$PWD:/data" plan-replay run drive.mcap --prior plan.png
FROM python:3.12-slim
# Mesa's software driver, with which `replay view --screenshot` draws without a screen.
RUN apt-get update \
    && apt-get install -y --no-install-recommends mesa-vulkan-drivers libvulkan1 \
    && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN pip install --no-cache-dir /src && rm -rf /src
ENV NUMBA_CACHE_DIR=/tmp/numba
WORKDIR /data
ENTRYPOINT ["replay"]
CMD ["--help"]
