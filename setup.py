"""Builds and installs rebt_ros; called by colcon."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = "rebt_ros"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Learns executable behavior trees from robot demonstrations (RE:BT-Espresso)",
    maintainer="rebt_ros maintainers",
    maintainer_email="maintainers@rebt-ros.org",
    license="Apache-2.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"], f"{PACKAGE}.behavior_tree": ["*.schema.json"]},
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
        "rosbags>=0.11",
        "scikit-learn>=1.4",
        "scipy>=1.11",
    ],
    extras_require={
        "pictures": ["matplotlib>=3.6"],
        "test": ["hypothesis", "jsonschema>=4.10", "pytest"],
        "upsampling": ["imbalanced-learn>=0.12"],
    },
    entry_points={
        "console_scripts": [
            f"demo = {PACKAGE}.commands.demo:main",
            f"demonstrator = {PACKAGE}.ros.demonstrator_node:main",
            f"executor = {PACKAGE}.ros.executor_node:main",
            f"generate = {PACKAGE}.commands.generate:main",
            f"learn = {PACKAGE}.commands.learn:main",
            f"learner = {PACKAGE}.ros.learner_node:main",
            f"recorder = {PACKAGE}.ros.recorder_node:main",
            f"replay = {PACKAGE}.commands.replay:main",
            f"robot = {PACKAGE}.ros.robot_node:main",
            f"simulate = {PACKAGE}.commands.simulate:main",
            f"synthetic_robot = {PACKAGE}.ros.synthetic_robot_node:main",
        ],
    },
)
