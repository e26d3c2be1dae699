"""`tireroad info`: what a result file holds."""

import json
from pathlib import Path

import h5py
import pytest
from synthetic_results import write_results

from tireroad.fem.errors import InputError
from tireroad.runs.results.info import describe


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_results(tmp_path_factory.mktemp("info") / "run")


def row(text: str, name: str) -> list[str]:
    (found,) = [line for line in text.splitlines() if line.split()[:1] == [name]]
    return found.split()


def test_datasets_with_shape_type_and_unit(results: Path) -> None:
    text = describe(results / "contact.h5")
    with h5py.File(results / "contact.h5") as file:
        points = file["points"].shape[0]
    assert row(text, "normal_force")[1:5] == ["(400,", f"{points})", "float64", "N"]
    assert "gzip vertical force of the road" in " ".join(row(text, "normal_force"))
    assert row(text, "active")[1:4] == ["(400)", "int64", "-"]
    assert "dB re 1 N" in describe(results / "spectra.h5")
    assert row(describe(results / "rotating.h5"), "eigenvalue")[2:4] == ["complex128", "1/s"]


def test_provenance_and_attributes(results: Path) -> None:
    text = describe(results / "static.h5")
    assert row(text, "processes")[1] == "2"
    assert row(text, "version")[1] == "0.1.0"
    assert row(text, "input_hash")[1] == "0f" * 32
    assert row(text, "rolling_radius")[1] == "0.316"
    assert row(text, "scene")[1] == "synthetic-torus,"
    assert f"h5py {h5py.__version__}" in text
    assert "[tire.material]" not in text, "the scene is named, not printed"


def test_a_foreign_file_is_described_too(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["scene"] = "not = = toml\n"
        file["name"] = "text"
        file["group/empty"] = h5py.Empty("f8")
    text = describe(tmp_path / "other.h5")
    assert row(text, "name")[1:5] == ["()", "text", "none", "given"]
    assert "group/empty" in text
    assert "not TOML" in text
    with h5py.File(tmp_path / "bare.h5", "w"):
        pass
    assert "no datasets" in describe(tmp_path / "bare.h5")


def test_control_characters_are_shown_and_not_obeyed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["title"] = "\x1b[31mred\x07\u202e"
        file["a\x1b[2J"] = 1.0
    text = describe(tmp_path / "other.h5")
    assert "\\x1b[31mred\\x07\\u202e" in text and "a\\x1b[2J" in text
    assert all(line.isprintable() for line in text.splitlines())


@pytest.mark.parametrize("kept", [0, 1, 7, 100, 5000])
def test_a_truncated_file_is_an_input_error(results: Path, tmp_path: Path, kept: int) -> None:
    (tmp_path / "cut.h5").write_bytes((results / "static.h5").read_bytes()[:kept])
    with pytest.raises(InputError, match=r"cut\.h5"):
        describe(tmp_path / "cut.h5")


def test_what_is_no_result_is_an_input_error(results: Path) -> None:
    with pytest.raises(InputError, match="not an HDF5 file"):
        describe(results / "scene.toml")
    with pytest.raises(InputError, match="no such file"):
        describe(results / "absent.h5")


def test_of_a_folder_the_files_in_it_are_named(results: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        describe(results)
    assert f"{results} is a folder: give one of {results / 'contact.h5'}, " in str(caught.value)
    assert str(results / "static.h5") in str(caught.value)
    with pytest.raises(InputError, match="a folder: it holds no .h5 file"):
        describe(tmp_path)


def test_the_same_for_programs(results: Path) -> None:
    found = json.loads(describe(results / "contact.h5", as_json=True))
    with h5py.File(results / "contact.h5") as file:
        assert found["datasets"]["normal_force"]["shape"] == list(file["normal_force"].shape)
        assert found["attributes"]["step"] == file.attrs["step"]
    assert found["datasets"]["normal_force"]["unit"] == "N"
    assert found["checksum"] == "right"
    assert "[tire.material]" in found["attributes"]["scene"], "in full"


def test_what_json_has_not_is_text_or_null(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["unknown"], file.attrs["several"] = float("nan"), [1.0, float("inf")]
        file["group/empty"] = h5py.Empty("f8")
    found = json.loads(describe(tmp_path / "other.h5", as_json=True))
    assert found["attributes"] == {"unknown": None, "several": [1.0, None]}
    assert found["datasets"]["group/empty"]["shape"] is None
