"""Names in a sentence: the first few of many are counted right, and a list ends with its last name."""

from __future__ import annotations

import tomllib

import pytest

from bayesid.words import and_list, counted, decimal_comma, did_you_mean, first_few


@pytest.mark.parametrize("count", range(7))
def test_names_shown_and_names_counted_make_all(count):
    names = [f"n{k}" for k in range(count)]
    shown, _, more = first_few(iter(names), 3).partition(" and ")
    listed = shown.split(", ") if shown else []
    assert listed == names[:3]
    assert len(listed) + int(more.removesuffix(" more") or 0) == count


def test_a_list_ends_with_its_last_name():
    texts = [and_list("abc"[:k]) for k in range(4)]
    assert texts == ["", "a", "a and b", "a, b and c"]


def test_one_is_not_many():
    assert [counted(k, "run") for k in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
    assert counted(2, "axis", "axes") == "2 axes"


def test_the_nearest_known_name_is_what_was_meant():
    known = ["N_v", "N_dr", "Y_v|v|"]
    assert did_you_mean(["N_dx"], known) == "; did you mean N_dr?"
    assert did_you_mean(["n_v", "Ndr"], known) == "; did you mean N_v, N_dr?"
    assert did_you_mean(["rubbish"], known) == did_you_mean([], known) == ""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = 1\nN_dr = -12,8\n", "; is -12,8 meant as -12.8?"),
        ("a = 1\nN_dr = 0,05  # per rad\n", "; is 0,05 meant as 0.05?"),
        ("a = 1\nN_dr = [1,2\n", ""),
        ("a = 1\nN_dr = twelve\n", ""),
    ],
)
def test_a_decimal_comma_is_asked_for_where_the_parser_stopped(text, said):
    with pytest.raises(tomllib.TOMLDecodeError) as found:
        tomllib.loads(text)
    assert decimal_comma(text.encode(), found.value) == said
