"""What clang-tidy finds in the firmware: kept as long as code and checks are the same."""

import shutil
import subprocess
import sys
from importlib import metadata

from gravcomp.firmware import static_check
from gravcomp.firmware.sources import CORE, firmware_folder, sources


def test_what_clang_tidy_has_found_is_kept_until_the_code_or_its_checks_change(tmp_path, monkeypatch):
    folder, ran = tmp_path / "gravcomp_hw" / "firmware", []
    shutil.copytree(firmware_folder(), folder)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "clang-tidy").touch()

    def run(command: list[str], **options: object) -> subprocess.CompletedProcess:
        ran.append(command)
        return subprocess.CompletedProcess(command, 1, f"{folder}/core/a.c:1:2: warning: odd [a-check]\n", "")

    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("GRAVCOMP_ROOT", str(tmp_path))
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(static_check, "provide_extra", lambda *_: None)
    monkeypatch.setattr(metadata, "version", lambda name: "1.0")
    monkeypatch.setattr(subprocess, "run", run)
    odd = ["gravcomp_hw/firmware/core/a.c:1:2: warning: odd [a-check]"]
    assert [static_check.findings() for _ in range(2)] == [odd, odd] and len(ran) == 1
    for count, changed in enumerate((sources(CORE)[0], folder / ".clang-tidy"), start=2):
        changed.write_text(changed.read_text(encoding="utf-8") + "\n", encoding="utf-8")
        assert static_check.findings() == odd and len(ran) == count
