"""Builds and installs rebt_ros; called by colcon."""

import shutil
import subprocess
from glob import glob
from platform import machine

from setuptools import find_packages, setup
from setuptools.command.install_scripts import install_scripts

PACKAGE = "rebt_ros"
NODES = ("demonstrator", "executor", "learner", "recorder", "robot", "studio", "synthetic_robot")

#: Begins an executable: it finds the package beside it, also where nothing was sourced.
OWN_MODULES = """\
import os, sys
sys.path.insert(0, os.path.join(
    os.path.dirname(os.path.dirname(os.path.realpath(__file__))),
    "python%d.%d" % sys.version_info[:2], "site-packages"))
"""


class InstallScripts(install_scripts):
    """Starts the nodes with SIGINT and SIGTERM blocked; rebt_ros.ros.entry unblocks them.

    Python needs a tenth of a second to come to the first line of a node.  A signal that comes in
    that time waits, where env can make it so (GNU coreutils 8.31 and newer).
    """

    def write_script(self, script_name, contents, mode="t", *ignored):
        """Writes an executable."""
        first, newline, rest = contents.partition("\n")
        blocking = _env_that_blocks() if script_name in NODES else None
        begin = _first_line(first, blocking) + newline
        super().write_script(script_name, begin + OWN_MODULES + rest, mode)


def _first_line(line, blocking):
    """The first line of an executable, or its first two.

    The kernel knows no quotes, so that where the path of the interpreter has a blank, a shell
    starts it.  To Python, what the shell reads is a string.

    Args:
        line: As setuptools writes it.
        blocking: What starts it with blocked signals, or nothing.
    """
    if not line.startswith("#!"):
        return line
    interpreter = line.removeprefix("#!").strip()
    if not interpreter.startswith('"'):
        return f"#!{blocking[0]} -S {blocking[1]} {interpreter}" if blocking else line
    start = " ".join([*(blocking or ()), interpreter])
    return f"#!/bin/sh\n'''exec' {start} \"$0\" \"$@\"\n' '''"


def _env_that_blocks():
    """What starts an interpreter with blocked signals, if that is possible: env and its option."""
    env = shutil.which("env")
    if env is None:
        return None
    blocking = (env, "--block-signal=INT,TERM")
    done = subprocess.run([*blocking, "true"], stderr=subprocess.DEVNULL, check=False)
    return blocking if done.returncode == 0 else None


setup(
    name=PACKAGE,
    version="0.2.0",
    description="Learns executable behavior trees from robot demonstrations (RE:BT-Espresso)",
    maintainer="rebt_ros maintainers",
    maintainer_email="maintainers@rebt-ros.org",
    license="Apache-2.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={
        PACKAGE: ["py.typed"],
        f"{PACKAGE}.behavior_tree": ["*.schema.json"],
        f"{PACKAGE}.inspection": ["*.schema.json"],
        f"{PACKAGE}.robot_file": ["*.schema.json"],
        f"{PACKAGE}.studio": ["page/*"],
        f"{PACKAGE}.verification": ["*.schema.json"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", sorted(glob("config/*.yaml") + glob("config/*.xml"))),
    ],
    zip_safe=False,
    python_requires=">=3.11",
    # Lower bounds: what Ubuntu 24.04 and ROS 2 Jazzy ship, where they ship it.  ROS itself (rclpy
    # and the messages) is not named: it comes with the ROS installation, never from PyPI.
    install_requires=[
        "joblib>=1.3",
        "networkx>=2.8",
        "numpy>=1.26",
        "py_trees>=2.3",
        "pyeda>=0.29",
        "pyyaml>=6",
        # Before that, rosbags brought another library for zstd than the one that we use as well.
        "rosbags>=0.11.7",
        "scikit-learn>=1.4",
        "scipy>=1.11",
    ],
    extras_require={
        "cluster": ["distributed>=2023.5", "joblib>=1.4"],
        # Box2D has wheels for one kind of processor; without it one task of many is left out.
        "driving": [f"gymnasium{'[box2d]' * (machine() == 'x86_64')}>=1", "minigrid>=3"],
        # BehaviorTree.CPP in Python, to test exported trees: wheels for one kind of processor.
        "engines": ["behaviortreepy>=0.1.4"] if machine() == "x86_64" else [],
        "groot2": ["pyzmq>=25"],
        "pictures": ["matplotlib>=3.6"],
        "studio": ["aiohttp>=3.9", "plotly>=5"],
        # btview watches as Groot2 does, independently of us.
        "test": [
            "btview>=0.2",
            "hypothesis",
            "jsonschema>=4.10",
            "pytest",
            "pytest-xdist>=3.8",
            "selenium>=4",
        ],
        "upsampling": ["imbalanced-learn>=0.12"],
    },
    cmdclass={"install_scripts": InstallScripts},
    entry_points={
        "console_scripts": [
            f"check = {PACKAGE}.commands.check:main",
            f"demo = {PACKAGE}.commands.demo:main",
            f"describe = {PACKAGE}.commands.describe:main",
            f"experiment = {PACKAGE}.commands.experiment:main",
            f"export = {PACKAGE}.commands.export:main",
            f"explain = {PACKAGE}.commands.explain:main",
            f"generate = {PACKAGE}.commands.generate:main",
            f"inspect = {PACKAGE}.commands.inspect:main",
            f"learn = {PACKAGE}.commands.learn:main",
            f"replay = {PACKAGE}.commands.replay:main",
            f"revise = {PACKAGE}.commands.revise:main",
            f"show = {PACKAGE}.commands.show:main",
            f"suggest-rules = {PACKAGE}.commands.suggest_rules:main",
            f"simulate = {PACKAGE}.commands.simulate:main",
            f"trial = {PACKAGE}.commands.trial:main",
            *(f"{node} = {PACKAGE}.ros.entry:{node}" for node in NODES),
        ],
    },
)
