# rebt_ros on ROS 2 Jazzy:
#   docker build -t rebt_ros .
#   docker run --rm -it --network host -v "$PWD:/data" -w /data rebt_ros ros2 run rebt_ros learn my_bag/
FROM ros:jazzy

SHELL ["/bin/bash", "-o", "pipefail", "-c"]
WORKDIR /ws
COPY package.xml src/rebt_ros/package.xml

# pyeda has no rosdep key (docs/install.md), and is compiled.  The image is the environment, so that
# pip may install beside apt (PEP 668).  Ubuntu keeps only the newest version of a package.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends gcc libc6-dev python3-dev python3-pip \
    && rosdep update --rosdistro jazzy \
    && PIP_BREAK_SYSTEM_PACKAGES=1 PIP_NO_CACHE_DIR=1 \
        rosdep install --from-paths src --ignore-src --dependency-types exec -y \
    && pip install --no-cache-dir --break-system-packages pyeda==0.29.0 \
    && apt-get purge -y --autoremove gcc libc6-dev python3-dev \
    && rm -rf /var/lib/apt/lists/*

COPY . src/rebt_ros
# The dollar is sed's: before the last line.
# hadolint ignore=SC2016
RUN source /opt/ros/jazzy/setup.bash \
    && colcon build --packages-select rebt_ros \
    && sed --in-place --expression '$isource /ws/install/setup.bash' /ros_entrypoint.sh

CMD ["ros2", "pkg", "executables", "rebt_ros"]
