from setuptools import find_packages, setup

package = "gravcomp_hw"

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
    description="The hardware side of gravcomp: the CAN bridge with its guard process, and the virtual robot",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "can_bridge = gravcomp_hw.can_bridge:main",
            "can_guard = gravcomp.motors.guard:main",
            "joint_bridge = gravcomp_hw.joint_bridge:main",
            "joint_robot = gravcomp_hw.joint_robot:main",
            "judge = gravcomp_hw.judge:main",
            "virtual_robot = gravcomp_hw.virtual_robot:main",
        ],
    },
)
