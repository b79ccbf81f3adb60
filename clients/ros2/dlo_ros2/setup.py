"""ament_python package; the SDK (`pip install clients/python`) is installed beside it."""

from setuptools import setup

NAME = "dlo_ros2"

setup(
    name=NAME,
    version="0.2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/dlo.launch.py"]),
        (f"share/{NAME}/config", ["config/dlo.yaml"]),
    ],
    install_requires=["setuptools"],
    entry_points={"console_scripts": [f"dlo_node = {NAME}.node:main"]},
)
