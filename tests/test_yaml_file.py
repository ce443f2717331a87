"""YAML from anybody: what is deep, explodes or is no mapping of words is refused before it is built."""

import pytest

from truenorth.core.errors import DataError
from truenorth.core.yaml_file import read_mapping

LAUGHS = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [{','.join(['*' + chr(97 + i)] * 9)}]\n" for i in range(9)
)
BAD = [
    "{{ }}: 1", "a: {{ }}", "{{ name }}", "a: 2024-13-45", "a: !!python/object:os.system x", "a: " + "[" * 2000 + "]" * 2000,
    LAUGHS, "a: &x [*x]", "a: " + "9" * 5000, "? [a, b]\n: 1", "a: \x00", "a: 1\na: 2", "a: !foo 3", "<<: 3", "a: !!timestamp x",
    "a: !!bool x", "a: !!int x", "- a", "a",
]  # fmt: skip


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_what_is_no_mapping_of_words_is_one_message(text, tmp_path):
    path = tmp_path / "spec.yaml"
    path.write_text(text)
    with pytest.raises(DataError, match=r"spec\.yaml") as error:
        read_mapping(path)
    assert "\n" not in str(error.value)


def test_what_an_anchor_stands_for_may_be_repeated(tmp_path):
    path = tmp_path / "spec.yaml"
    path.write_text("gyro: &one {bias: 1 deg/h}\naccel: *one\n")
    assert read_mapping(path) == {"gyro": {"bias": "1 deg/h"}, "accel": {"bias": "1 deg/h"}}


def test_a_large_file_is_not_read(tmp_path):
    path = tmp_path / "spec.yaml"
    path.write_bytes(b"a: 1\n" * (1 << 19))
    with pytest.raises(DataError, match="larger than 1 MiB"):
        read_mapping(path)
