"""Work in two processes is the same work, whatever happens to the second one."""

import os
import signal
import time
from pathlib import Path

import pytest

from analysis.explain import abreast as module
from analysis.explain.abreast import abreast


@pytest.fixture(autouse=True)
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a machine with two, whatever this one has: two processes may share one core."""
    monkeypatch.setattr(module, "_two_cores", lambda: True)


def children() -> set[str]:
    """Processes that the first thread has begun and not yet seen to their end; other tests' may be among them."""
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


def slowly(x: int) -> tuple[int, int]:
    time.sleep(0.005)  # so that both processes find work
    return x * x, os.getpid()


class TestAbreast:
    def test_answers_come_in_order_from_two_processes(self):
        found = abreast(slowly, range(40))
        assert [square for square, _ in found] == [x * x for x in range(40)]
        assert len({pid for _, pid in found}) == 2

    def test_the_largest_are_taken_first(self):
        found = abreast(lambda k: (k, slowly(k)[1], time.monotonic_ns()), range(20), size=lambda k: k % 10)
        assert [k for k, _, _ in found] == list(range(20))
        for pid in {pid for _, pid, _ in found}:
            taken = [k % 10 for k, _, _ in sorted(found, key=lambda f: f[2]) if found[k][1] == pid]
            assert taken == sorted(taken, reverse=True)

    def test_shared_objects_stay_themselves(self):
        things = [object() for _ in range(20)]
        found = abreast(lambda k: (slowly(k), {"here": things[k]}), range(20), things)
        assert len({pid for (_, pid), _ in found}) == 2
        assert all(answer["here"] is thing for (_, answer), thing in zip(found, things, strict=True))

    def test_what_the_second_process_raises_is_raised_here(self):
        here = os.getpid()

        def fails(x: int) -> int:
            slowly(x)
            if os.getpid() != here:
                raise ArithmeticError("there")
            return x

        with pytest.raises(ArithmeticError, match="there"):
            abreast(fails, range(20))

    def test_what_is_raised_here_leaves_no_process_behind(self):
        here = os.getpid()

        def fails(x: int) -> int:
            if os.getpid() == here:
                raise ArithmeticError("here")
            time.sleep(60.0)
            return x

        begun, before = time.monotonic(), children()
        with pytest.raises(ArithmeticError, match="here"):
            abreast(fails, range(20))
        assert time.monotonic() - begun < 30.0
        assert children() <= before

    def test_work_of_a_killed_process_is_done_again(self):
        here = os.getpid()

        def killed(x: int) -> int:
            slowly(x)
            if os.getpid() != here:
                os.kill(os.getpid(), signal.SIGKILL)
            return x

        assert abreast(killed, range(12)) == list(range(12))

    def test_what_cannot_be_sent_is_made_again_here(self):
        found = abreast(lambda k: (slowly(k), lambda: k), range(12))
        assert [made() for _, made in found] == list(range(12))
        assert {pid for (_, pid), _ in found} == {os.getpid()}

    def test_one_core_works_alone(self, monkeypatch):
        monkeypatch.setattr(module, "_two_cores", lambda: False)
        assert {pid for _, pid in abreast(slowly, range(10))} == {os.getpid()}

    @pytest.mark.parametrize("count", [0, 1, 2, module._MOST + 1])
    def test_any_number_of_items(self, count):
        assert abreast(lambda x: -x, range(count)) == [-x for x in range(count)]
