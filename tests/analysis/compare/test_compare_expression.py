"""Expressions and templates: they compute what Python computes, and refuse everything else."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.compare.expression import Expression
from analysis.compare.template import Template

CELLS = {"a": 3.5, "b": -2.0, "x.y": 0.25, "Set 1_CLTC_fc": 8203.0, "größe": 7.0}
leaves = st.sampled_from(["a", "b", "2", "0.5", "1e3", ".25"])
sums = st.recursive(
    leaves,
    lambda inner: (
        st.tuples(inner, st.sampled_from(["+", "-", "*", " / "]), inner).map("".join)
        | inner.map(lambda e: f"({e})")
        | inner.map(lambda e: f"-{e}")
    ),
    max_leaves=12,
)


@given(sums)
def test_an_expression_has_the_value_python_gives(text: str) -> None:
    expression = Expression.parse(text)
    assert set(expression.columns) <= {"a", "b"}
    try:
        expected = eval(text, {"__builtins__": {}}, {"a": 3.5, "b": -2.0})
    except ZeroDivisionError:
        with pytest.raises(ZeroDivisionError):
            expression.value(CELLS)
        return
    assert expression.value(CELLS) == pytest.approx(expected, rel=1e-12, abs=1e-12)  # rounding of -x and 0 - x


def test_odd_names_stand_in_backticks() -> None:
    expression = Expression.parse("`Set 1_CLTC_fc` - 2*x.y + größe")
    assert expression.columns == ("Set 1_CLTC_fc", "x.y", "größe")
    assert expression.value(CELLS) == 8203.0 - 0.5 + 7.0


def test_what_is_missing_makes_the_whole_missing() -> None:
    assert math.isnan(Expression.parse("a + b").value({"a": 1.0, "b": math.nan}))
    assert math.isnan(Expression.parse("a / b").value({"a": math.nan, "b": 0.0}))
    with pytest.raises(ZeroDivisionError):
        Expression.parse("a / b").value({"a": 1.0, "b": 0.0})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a number or a column is expected at the end"),
        ("a +", "expected at the end"),
        ("a b", "character 3: 'b' is not expected"),
        ("(a", "a '\\)' is missing"),
        ("a)", "character 2: '\\)' is not expected"),
        ("a ** 2", "character 4"),
        ("a // b", "character 4"),
        ("__import__('os')", "'\\(' is not expected"),
        ("a[0]", "character 2: only numbers, columns"),
        ("3x", "character 1: only numbers"),
        ("1.2.3", "character 1: only numbers"),
        ("`a", "character 1: only numbers"),
        ("a % b", "character 3"),
        ("(" * 60 + "a" + ")" * 60, "too many parentheses"),
        ("-" * 60 + "a", "too many parentheses or signs"),
        ("a+" * 300 + "a", "too long"),
    ],
)
def test_anything_else_is_refused_with_its_place(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Expression.parse(text)


@given(st.text(max_size=40))
def test_no_text_breaks_the_parser(text: str) -> None:
    try:
        expression = Expression.parse(text)
    except ValueError:
        return
    try:
        expression.value(dict.fromkeys(expression.columns, 1.0))
    except ZeroDivisionError:
        assert "/" in text


def test_a_template_fills_and_matches() -> None:
    template = Template.parse("Set {set}_{meter}_fc")
    assert template.fill({"set": "1", "meter": "CLTC"}) == "Set 1_CLTC_fc"
    found = template.pattern().fullmatch("Set 1_CLTC_fc")
    assert found is not None
    assert found.groups() == ("1", "CLTC")
    assert template.pattern().fullmatch("set 1_CLTC_fc") is None
    assert Template.parse("T{a}").fill({"a": ""}) == ""
    assert Template.parse("{a} {b}").fill({"a": "", "b": "1"}) == " 1"
    assert Template.parse("clear").fill({}) == "clear"
    for text in ("{", "}a{", "{}", "{{a}}", "{a} }"):
        with pytest.raises(ValueError, match="braces"):
            Template.parse(text)
