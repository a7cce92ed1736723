"""How the kernels are compiled, and when their kept code is outdated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.extending import intrinsic

from nldyn.runtime.kernel_cache import ensure_cache, resting_on
from nldyn.system import contact_law, linear

ensure_cache()

# the compile cache looks at the file of a function alone, not at those of the kernels it calls
OURS = sorted(map(str, Path(__file__).parent.glob("*.py")))
FILES = (*OURS, linear.__file__, contact_law.__file__)

njit: Any = numba.njit  # its stubs lack the options that spare what only Python callers need
# a kernel that Python calls
entry = resting_on(njit(cache=True, nogil=True, error_model="numpy"), *FILES)
# kernels that are called by other kernels only
inner = resting_on(
    njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True), *FILES
)
# those with one caller: every level of calls is optimised anew, so this saves compile time
inlined = resting_on(njit(cache=True, error_model="numpy", inline="always"), *FILES)


@intrinsic
def never_inline(typing):
    """Keep the function apart from which it is called: rare code that would cost compile time."""
    return types.void(), _marking("noinline")


@intrinsic
def always_inline(typing):
    """Inline the function from which it is called, though rare code makes it look long."""
    return types.void(), _marking("alwaysinline")


def _marking(attribute):
    """Code generator that only gives the function at hand an attribute."""

    def codegen(context, builder, signature, arguments):
        builder.function.attributes.add(attribute)
        return context.get_dummy_value()

    return codegen
