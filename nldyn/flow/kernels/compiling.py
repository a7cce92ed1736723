"""How the kernels are compiled, and when their kept code is outdated."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
from numba import types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model

from nldyn.base import arrays
from nldyn.runtime.kernel_cache import ensure_cache, resting_on
from nldyn.system import contact_law, linear

ensure_cache()

# the compile cache looks at the file of a function alone, not at those of the kernels it calls
OURS = sorted(map(str, Path(__file__).parent.glob("*.py")))
FILES = (*OURS, arrays.__file__, linear.__file__, contact_law.__file__)


class _WithinCallers(JITCodeLibrary):
    """Code of a kernel that other kernels call: it is optimised and translated as part of them.

    numba optimises each function together with all that it calls and makes machine code of both,
    so that code ten calls deep would be compiled ten times.
    """

    codegen: Any = SimpleNamespace(set_env=lambda *_: None)  # has no place yet: see `_Entry`

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0


class _Compiler(CompilerBase):
    """numba's compiler."""

    def define_pipelines(self) -> list[Any]:
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


class _Inner(_Compiler):
    """numba's compiler, its last steps left to the caller's."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.library = _WithinCallers(self.state.targetctx.codegen(), "inner")


class _Entry(_Compiler):
    """numba's compiler; what it compiles also brings the environments of the inner kernels."""

    def compile_extra(self, function: Any) -> Any:
        result = super().compile_extra(function)
        for environment in result._find_referenced_environments():
            result.library.codegen.set_env(environment.env_name, environment)
        return result


_jit: Any = numba.njit  # its stubs lack the options that spare what only Python callers need


def _kernel(**options: bool) -> Any:
    """Decorator of a kernel that other kernels call; it is compiled once for all constants."""
    compiled = _jit(
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=_Inner,
        **options,
    )

    def decorate(function: Any) -> Any:
        kernel = compiled(function)
        template = kernel.get_call_template
        kernel.get_call_template = lambda arguments, named: template(
            tuple(map(types.unliteral, arguments)), named
        )
        return kernel

    return decorate


njit: Any = partial(_jit, pipeline_class=_Entry)
# a kernel that Python calls
entry = resting_on(njit(cache=True, nogil=True, error_model="numpy"), *FILES)
# Kernels that are called by other kernels only. They make no arrays, nor call what does: so
# references need not be counted, which would cost as much time as what they compute.
inner = _kernel(_nrt=False)
# such as make arrays, or call what does
allocating = _kernel()
# those with one caller, as part of its text
inlined = _jit(error_model="numpy", inline="always")


class _Reference(types.Type):
    """A named tuple by its address: its thirteen arrays are a hundred numbers to pass."""

    def __init__(self, structure: Any) -> None:
        self.structure = structure
        super().__init__(f"reference to {structure}")


@register_model(_Reference)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _Reference) -> None:
        address = manager.lookup(kind.structure).get_value_type().as_pointer()
        super().__init__(manager, kind, address)


@infer_getattr
class _ReferenceFields(AttributeTemplate):
    key = _Reference

    def generic_resolve(self, value: Any, attr: str) -> Any:  # type: ignore[override]
        fields = value.structure.fields
        return value.structure.types[fields.index(attr)] if attr in fields else None


@lower_getattr_generic(_Reference)
def _field(context: Any, builder: Any, kind: _Reference, address: Any, name: str) -> Any:
    place = kind.structure.fields.index(name)
    value = builder.load(cgutils.gep_inbounds(builder, address, 0, place))
    return impl_ret_borrowed(context, builder, kind.structure.types[place], value)


@intrinsic
def by_reference(typing, structure):
    """Address of a named tuple; its arrays must live until `keep` tells that they may go."""

    def codegen(context, builder, signature, arguments):
        address = cgutils.alloca_once(builder, arguments[0].type)
        builder.store(arguments[0], address)
        return address

    return _Reference(structure)(structure), codegen


@intrinsic
def keep(typing, structure):
    """Nothing but a use of a named tuple, so that its arrays are not released before."""
    return types.void(structure), lambda context, *_: context.get_dummy_value()


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
