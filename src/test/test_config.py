"""Configuration errors name the file, the key, what was found and what is allowed; units are converted when a file is read."""

from dataclasses import dataclass

import pytest

from gravcomp.config import ConfigError, declared_parameters, from_mapping, load_yaml, parameter, to_mapping


@dataclass(frozen=True)
class Tube:
    length: float = parameter(edge="mm", minimum=1, maximum=2000, description="length at rest")
    law: str = parameter("svk", choices=("svk", "neo_hookean"), description="law")


@dataclass(frozen=True)
class Body:
    tubes: tuple[Tube, ...] = parameter(description="tubes")
    angle: float = parameter(90.0, edge="deg", minimum=-180, maximum=180, description="angle")
    offset: tuple[float, float] = parameter((1.0, 2.0), edge="mm", description="offset")
    count: int | None = parameter(None, minimum=1, description="count")


def test_edge_units_become_si_and_come_back():
    body = from_mapping(Body, {"tubes": [{"length_mm": 50}]}, source="f.yaml")
    assert body.tubes[0].length == pytest.approx(0.05)
    assert body.angle == pytest.approx(1.5707963)
    assert body.offset == pytest.approx((0.001, 0.002))
    assert from_mapping(Body, to_mapping(body), source="again") == body
    assert to_mapping(body)["tubes"][0]["length_mm"] == 50.0


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ({"tubes": [{"length_mm": -5}]}, ["f.yaml", "tubes[0].length_mm", "-5", "1 to 2000 mm"]),
        ({"tubes": [{"length_mm": 0.05}]}, ["1 to 2000 mm (looks like m: 50 mm)"]),
        ({"tubes": [{"length_mm": 0.5}]}, ["looks like cm: 5 mm or m: 500 mm"]),
        ({"tubes": [{"lenght_mm": 5}]}, ["f.yaml", "tubes[0].lenght_mm", "did you mean 'length_mm'"]),
        ({"tubes": [{}]}, ["f.yaml", "tubes[0].length_mm", "missing"]),
        ({"tubes": 3}, ["f.yaml", "tubes", "3", "list"]),
        ({"tubes": [], "count": 1.5}, ["count", "1.5", "whole number"]),
        ({"tubes": [], "count": True}, ["count", "True", "whole number"]),
        ({"tubes": [], "angle_deg": float("nan")}, ["angle_deg", "nan", "finite"]),
        ({"tubes": [], "angle_deg": "x"}, ["angle_deg", "'x'", "number"]),
        ({"tubes": [{"length_mm": 5, "law": "hooke"}]}, ["tubes[0].law", "'hooke'", "svk, neo_hookean"]),
        ({"tubes": [], "offset_mm": [1]}, ["offset_mm", "1 entries", "2"]),
        ([], ["f.yaml", "mapping"]),
    ],
)
def test_bad_values_are_refused_with_what_was_found_and_what_is_allowed(mapping, words):
    with pytest.raises(ConfigError) as error:
        from_mapping(Body, mapping, source="f.yaml")
    for word in words:
        assert word in str(error.value)


def test_declared_parameters_list_edge_defaults():
    declared = {p.key: p for p in declared_parameters(Body)}
    assert declared["angle_deg"].default == 90.0
    assert declared["offset_mm"].default == [1.0, 2.0]
    assert declared["angle_deg"].parameter.edge_unit == "deg"


@pytest.mark.parametrize(("text", "words"), [("a: [1", ["line"]), ("a: 1\na: 2", ["line 2", "twice"]), ("\tb: 1", ["line 1"])])
def test_broken_yaml_names_the_line(tmp_path, text, words):
    path = tmp_path / "robot.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_yaml(path)
    for word in [str(path), *words]:
        assert word in str(error.value)


@pytest.fixture
def without_slow_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PyYAML's own reader, which takes seconds for a deep document and ten times as long as libyaml for a large one."""
    monkeypatch.setattr("gravcomp.config.yaml_file._StrictLoader", None)


@pytest.mark.usefixtures("without_slow_reader")
def test_a_large_document_is_read_by_libyaml(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("- [1, 2, {a: 3}]\n" * 6_000, encoding="utf-8")
    assert load_yaml(path) == 6_000 * [[1, 2, {"a": 3}]]


@pytest.mark.usefixtures("without_slow_reader")
@pytest.mark.parametrize("depth", [2_000, 100_000])
def test_a_document_that_is_nested_too_deeply_is_refused(tmp_path, depth):
    """Libyaml ends the process where its stack overflows."""
    path = tmp_path / "robot.yaml"
    path.write_text("[" * depth, encoding="utf-8")
    with pytest.raises(ConfigError, match="is nested too deeply"):
        load_yaml(path)


@dataclass(frozen=True)
class Drive:
    travel: float = parameter(3.0, edge="mm", description="travel", renamed_from="stroke_mm")


def test_a_renamed_key_is_refused_and_the_error_names_the_new_key():
    with pytest.raises(ConfigError, match=r"f.yaml: key 'drive\.stroke_mm' has been renamed; write 'travel_mm' instead"):
        from_mapping(Drive, {"stroke_mm": 4.0}, source="f.yaml", key="drive")


@dataclass(frozen=True)
class Brake:
    force: float = parameter(3.0, unit="N", description="force", renamed_from="strength", accepted_until="999.0")
    torque: float = parameter(3.0, unit="N m", description="torque", renamed_from="moment", accepted_until="0.0")


def test_an_earlier_key_is_taken_with_a_warning_for_a_release():
    with pytest.warns(
        FutureWarning, match=r"f.yaml: key 'brake\.strength' has been renamed; write 'force'.*until release 999\.0"
    ):
        assert from_mapping(Brake, {"strength": 4.0}, source="f.yaml", key="brake").force == 4.0
    with pytest.raises(ConfigError, match=r"'brake\.strength' and its new name 'force' are both given"):
        from_mapping(Brake, {"strength": 4.0, "force": 5.0}, source="f.yaml", key="brake")
    with pytest.raises(ConfigError, match=r"key 'brake\.moment' has been renamed; write 'torque' instead"):
        from_mapping(Brake, {"moment": 4.0}, source="f.yaml", key="brake")


@dataclass(frozen=True)
class Winch:
    drive: Drive = parameter(default_factory=Drive, description="drive")


def test_a_declared_parameter_has_the_dotted_key_of_its_earlier_name():
    (leaf,) = declared_parameters(Winch)
    assert (leaf.key, leaf.earlier_key) == ("drive.travel_mm", "drive.stroke_mm")
