"""Figures with their limits: on the terminal, and in the document that a command updates."""

import pytest

from gravcomp.bench import limits
from gravcomp.commands.bench import BENCHMARKS
from gravcomp.config import ConfigError
from gravcomp.report.figures_table import check_place, markdown_table, renew
from gravcomp.report.result import Figure

DOCUMENT = "before\n<!-- figures bench engine -->\nold\n<!-- end -->\nbetween\n<!-- figures bench graph -->\nkept\n<!-- end -->\n"


def test_every_benchmark_has_its_figures():
    assert set(limits.ROWS) == set(BENCHMARKS)


def test_a_figure_is_found_below_its_key_and_a_list_counts():
    figures = limits.figures("faults", {"crashes": 2, "safe_ms": {"stop": 12.5}, "not_safe": ["stall", "bus-off"]})
    values = {"crashes": 2, "time from stop to zero current": 12.5, "faults without a safe response": 2}
    assert {f.name: f.value for f in figures} == values
    assert [f.reached for f in figures] == [False, False, True]


def test_every_value_of_a_mapping_is_a_figure():
    figures = limits.figures("streams", {"missed": {"jitter": 0, "gaps": 2}, "excess_deg": {"gyro_spikes": 0.1, "gaps": 0.4}})
    assert [(f.name.partition(":")[0], f.value, f.reached) for f in figures] == [
        ("jitter", 0, True),
        ("gaps", 2, False),
        ("gyroscope spikes", 0.1, True),
    ]


def test_a_missed_limit_is_said():
    text = markdown_table(
        [Figure("error", 0.3, "mm", limit=0.2), Figure("rate", 5.0, "Hz", limit=5.0, at_least=True), Figure("length", 1.0, "m")]
    )
    assert "| error | 0.300 mm | ≤ 0.2 mm | **missed** |" in text
    assert "| rate | 5.00 Hz | ≥ 5 Hz | reached |" in text
    assert "| length | 1.00 m |  |  |" in text


def test_only_the_command_s_own_table_is_renewed(tmp_path):
    path = tmp_path / "figures.md"
    path.write_text(DOCUMENT, encoding="utf-8")
    for value in (1.0, 2.0):  # the second time over the first's
        renew(path, "bench engine", [Figure("error", value, "mm")])
    text = path.read_text(encoding="utf-8")
    assert "| error | 2.00 mm |" in text and "1.00" not in text and "old" not in text
    assert text.startswith("before\n<!-- figures bench engine -->\n") and text.endswith("kept\n<!-- end -->\n")


def test_a_document_without_a_place_is_refused_before_anything_is_measured(tmp_path):
    path = tmp_path / "figures.md"
    with pytest.raises(ConfigError, match="cannot be read"):
        check_place(path, "bench engine")
    path.write_text(DOCUMENT, encoding="utf-8")
    check_place(path, "bench engine")
    with pytest.raises(ConfigError, match="<!-- figures bench soak -->"):
        check_place(path, "bench soak")
