from setuptools import find_packages, setup

package = "gravcomp_estimation"

setup(
    name=package,
    version="0.1.0",
    packages=find_packages(include=[package, f"{package}.*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package}"]),
        (f"share/{package}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    maintainer="gravcomp maintainers",
    maintainer_email="maintainers@gravcomp.invalid",
    description="The estimation side of gravcomp: orientation and gravity from the IMU, temperature control, replays",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "imu_estimator = gravcomp_estimation.imu_estimator:main",
            "imu_replay = gravcomp_estimation.imu_replay:main",
            "arm_gravity = gravcomp_estimation.arm_gravity:main",
        ],
    },
)
