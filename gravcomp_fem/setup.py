from glob import glob

from setuptools import find_packages, setup

package = "gravcomp_fem"

setup(
    name=package,
    version="0.1.0",
    packages=find_packages(include=[package, f"{package}.*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
        (f"share/{package}/urdf", sorted(glob("urdf/*.xacro"))),
        (f"share/{package}/config", sorted(glob("config/*"))),
        (f"share/{package}/launch", sorted(glob("launch/*"))),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    maintainer="gravcomp maintainers",
    maintainer_email="maintainers@gravcomp.invalid",
    description="The model side of gravcomp: the simulator of the deformation, the inverse controller and the viewer",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "composed_loop = gravcomp_fem.composed_loop:main",
            "fem_simulator = gravcomp_fem.fem_simulator:main",
            "inverse_controller = gravcomp_fem.inverse_controller:main",
            "viewer = gravcomp_fem.viewer:main",
            "recorder = gravcomp_fem.recorder:main",
            "calibrator = gravcomp_fem.calibrator:main",
            "arm_player = gravcomp_fem.arm_player:main",
        ],
    },
)
