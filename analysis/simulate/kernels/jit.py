"""How the kernels are compiled: cached on disk under a name that changes with any of their sources.

numba notices a change of a function's own file only; a kernel that calls into another file would silently keep the
old code. So the cache lives in a folder named after the content of all kernel files and of the sheets'
(`analysis.bsdf`), outside the installation (which may be read-only).
"""

import inspect
from collections.abc import Callable
from typing import Any, Final, TypeVar

import numba
from numba.core import cgutils
from numba.extending import intrinsic

from analysis.simulate.store import cache_folder, code_digest

F = TypeVar("F", bound=Callable[..., Any])
A = TypeVar("A")

_FOLDER: Final = (
    cache_folder("numba") / f"{code_digest('analysis/simulate/kernels', 'analysis/bsdf')}-{numba.__version__}"
)


def _compiled(function: F, **how: bool) -> F:
    config = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(_FOLDER)
    try:
        compiled: F = numba.njit(nogil=True, fastmath=True, error_model="numpy", **how)(function)
    finally:
        config.CACHE_DIR = before
    return compiled


def _called_by_kernels(function: F, *, forceinline: bool) -> F:
    """Compile what Python never calls: each way in that is spared would be compiled with all that it calls."""
    return _compiled(function, forceinline=forceinline, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def kernel(function: F) -> F:
    """Compile a function that Python calls: without the interpreter lock, cached on disk, arithmetic reordered."""
    return _compiled(function, cache=True, no_cfunc_wrapper=True)


def part(function: F) -> F:
    """Compile a large part of a kernel that is called, not copied."""
    return _called_by_kernels(function, forceinline=False)


def jit(function: F) -> F:
    """Compile a part that becomes code of its caller: passing many arrays costs more than most parts themselves."""
    return _called_by_kernels(function, forceinline=True)


def as_python(function: F) -> F:
    """What `jit` compiled, as Python itself would run it; it must not call other compiled parts."""
    plain: F = inspect.unwrap(function)
    return plain


def _borrowed(typing_context: Any, array: Any) -> Any:
    """The same array without reference counting: counting costs more than tracing when kernels call each other.

    The caller of the outermost kernel holds the arrays until it returns.
    """

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, value=arguments[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return array(array), build


borrowed: Callable[[A], A] = intrinsic(_borrowed)
