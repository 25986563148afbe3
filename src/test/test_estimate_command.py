"""`gravcomp estimate`: figures as JSON, arrays in a file, and one sentence for what cannot be used."""

import json

import numpy as np

from gravcomp.commands.__main__ import main


def run(*arguments):
    return main(["estimate", *map(str, arguments)])


def write_trial(path, count=600):
    random = np.random.default_rng(1)
    np.savez(
        path,
        gyr=random.normal(0, 0.002, (count, 3)),
        acc=np.array([0, 0, 9.81]) + random.normal(0, 0.02, (count, 3)),
        quat=np.tile([1.0, 0, 0, 0], (count, 1)),
        movement=np.ones(count, bool),
        rate=100.0,
    )
    return path


def test_a_trial_is_judged_and_written(tmp_path, capsys):
    out = tmp_path / "out.npz"
    assert run(write_trial(tmp_path / "trial.npz"), "--out", out, "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["samples"] == 600 and figures["inclination_rmse_deg"] < 0.3
    with np.load(out) as arrays:
        assert arrays["quat"].shape == (600, 4) and arrays["gravity"].shape == (600, 3)
        assert arrays["rest"].dtype == bool and arrays["bias"].shape == (600, 3)


def test_a_file_that_cannot_be_used_is_one_sentence_and_code_2(tmp_path, capsys):
    (tmp_path / "bad.npz").write_text("nothing", encoding="utf-8")
    assert run(tmp_path / "bad.npz") == 2
    assert "bad.npz: is not an .npz file" in capsys.readouterr().err


def test_it_says_in_words_what_the_json_says(tmp_path, capsys):
    assert run(write_trial(tmp_path / "trial.npz"), "--average", 2) == 0
    text = capsys.readouterr().out
    assert "300 samples" in text and "inclination RMSE" in text and "at rest" in text
