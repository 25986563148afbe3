from setuptools import find_packages, setup

package = "gravcomp_node"

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
    description="The base of all gravcomp nodes: parameters, lifecycle, diagnostics, executor",
    license="Apache-2.0",
)
