from setuptools import find_packages, setup

setup(
    name="gravcomp",
    version="0.1.0",
    packages=find_packages(include=["gravcomp", "gravcomp.*"]),
    package_data={
        "gravcomp": [
            "robots/*",
            "canbus/*.dbc",
            "environment/*.in",
            "environment/*.xml",
            "references/*.csv",
            "experiments/measured/*.yaml",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/gravcomp"]),
        ("share/gravcomp", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="gravcomp maintainers",
    maintainer_email="maintainers@gravcomp.invalid",
    description="Gravity compensation for soft slender robots: the core, without ROS",
    license="Apache-2.0",
)
