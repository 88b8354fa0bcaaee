"""Numbers of a text read at once are those that Python reads one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.photometry.decimals import plain_decimals, words

DECIMAL = st.from_regex(r"-?([0-9]{1,15}|[0-9]{1,8}\.[0-9]{0,7}|\.[0-9]{1,15})", fullmatch=True)
BLANK = st.text(" \t\r\n\v\f", min_size=1, max_size=3)


def read(text: bytes) -> np.ndarray | None:
    array = np.frombuffer(text, dtype=np.uint8)
    return plain_decimals(array, *words(array))


@given(st.lists(st.tuples(BLANK, DECIMAL)), st.sampled_from(["", " ", "\r\n"]))
def test_every_number_is_the_one_python_reads(pieces: list[tuple[str, str]], end: str) -> None:
    values = read(("".join(blank + number for blank, number in pieces) + end).encode())
    ours = np.asarray(values)
    theirs = np.array([float(number) for _, number in pieces])
    assert ours.tobytes() == theirs.tobytes()  # to the last bit, and the sign of zero


@given(st.binary(max_size=60))
def test_words_are_those_of_split(text: bytes) -> None:
    starts, lengths = words(np.frombuffer(text, dtype=np.uint8))
    assert [text[a : a + n] for a, n in zip(starts, lengths, strict=True)] == text.split()


@given(st.text("0123456789.-+eE_x ", min_size=1, max_size=40))
def test_nothing_else_is_taken_for_a_number(text: str) -> None:
    values = read(text.encode())
    if values is not None:
        assert values.tolist() == [float(word) for word in text.split()]


@pytest.mark.parametrize("word", ["1e3", "+1", "1-2", "--1", "-", ".", "1.2.3", "1_000", "1234567890123456", "nan"])
def test_what_is_more_than_a_plain_decimal_is_left_to_others(word: str) -> None:
    assert read(f"1 {word} 2".encode()) is None
