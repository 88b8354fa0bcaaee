"""Who waits for a compiler is told so, and nobody else."""

import click
import numba
from click.testing import CliRunner

from labdaq.cli._first_time import WORDS, compiling_is_told


def test_compiling_is_told_once_and_only_when_it_happens() -> None:
    twice = numba.njit(lambda x: 2 * x)
    thrice = numba.njit(lambda x: 3 * x)

    @click.command()
    def work() -> None:
        with compiling_is_told():
            click.echo(twice(2) + thrice(2))

    first, again = CliRunner().invoke(work), CliRunner().invoke(work)
    assert first.stdout == again.stdout == "10\n"
    assert first.stderr == WORDS + "\n" and again.stderr == ""
    numba.njit(lambda x: 4 * x)(1)  # afterwards nobody listens


def test_a_run_without_a_compiler_says_nothing() -> None:
    done = CliRunner().invoke(click.Command("x", callback=_nothing))
    assert done.exit_code == 0 and done.stderr == ""


def _nothing() -> None:
    with compiling_is_told():
        pass
