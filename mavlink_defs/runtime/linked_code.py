"""Code that is only linked into that of its callers.

Numba optimises every function and makes machine code of it, also of one that only compiled code
calls; and then once more of the copy in each caller. Here such a function stays in the
intermediate language of LLVM, and only the callers that Python calls are optimised as a whole and
become machine code. That takes three tenths off the time to compile; results keep their bits.
"""

from typing import Any

from llvmlite import binding
from numba.core import codegen, compiler, environment

# what is used of numba has no annotations
_Compiler: Any = compiler.Compiler
_Library: Any = codegen.JITCodeLibrary
_Result: Any = compiler.CompileResult
_result: Any = compiler.compile_result
_known_environment: Any = environment.lookup_environment
_KIND = "linked"
_ENVIRONMENT = "_ZN08NumbaEnv"  # what the names of variables that hold one begin with


class _LinkedLibrary(_Library):
    """Code for callers: neither optimised as a whole nor made into machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> "_LinkedLibrary":
        return self

    def set_env(self, name: str, env: object) -> None:
        """Leave the variable of an environment to the library that has its memory."""

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return the library as it is cached."""
        return self.name, _KIND, self._get_module_for_linking().as_bitcode()


class _EntryLibrary(_Library):
    """Code that Python calls, with that of all functions that it calls."""

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        for variable in self._final_module.global_variables:
            env = None
            if variable.name.startswith(_ENVIRONMENT):
                env = _known_environment(variable.name)
            if env is not None:
                self._codegen.set_env(variable.name, env)


class LinkedCompiler(_Compiler):
    """Compiles a function that only compiled code calls; a pipeline class of numba."""

    _library = _LinkedLibrary

    def define_pipelines(self) -> Any:
        """Return numba's own pipelines, after choosing the library that the code goes to."""
        state = self.state
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


class EntryCompiler(LinkedCompiler):
    """Compiles a function that Python calls; a pipeline class of numba."""

    _library = _EntryLibrary


def rebuilt(target_context: Any, reduced: tuple[Any, ...]) -> Any:
    """Return numba's result of a compilation from what its `_reduce` has made of it."""
    (name, kind, code), description, env, signature, mode, lifted, types, reload, envs = reduced
    if kind != _KIND:
        return _Result._rebuild(target_context, *reduced)
    for function in reload:
        function()
    library = _LinkedLibrary(target_context.codegen(), name)
    library._final_module = library._shared_module = binding.parse_bitcode(code)
    library._finalized = True
    return _result(
        typing_context=target_context.typing_context,
        target_context=target_context,
        entry_point=target_context.get_executable(library, description, env),
        type_annotation=types,
        signature=signature,
        objectmode=mode,
        lifted=lifted,
        fndesc=description,
        library=library,
        environment=env,
        reload_init=reload,
        referenced_envs=envs,
    )
