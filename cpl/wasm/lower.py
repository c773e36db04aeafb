"""From the kernels' LLVM to one WebAssembly module.

numba types and lowers the same functions that the native engine runs; what it hands to LLVM is
taken before it is optimised for this machine's processor, given to the wasm32 target, and linked.
The module imports nothing: no libm, no memory, no allocator. Where numba would raise it traps.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba import cfunc, types

from cpl import portable
from cpl.wasm._exports import EXPORTS
from cpl.wasm.softfloat import fused, remainder

__all__ = ["build", "lowered"]

_TRIPLE = "wasm32-unknown-unknown"
_LAYOUT = "e-m:e-p:32:32-p10:8:8-p20:8:8-i64:64-i128:128-n32:64-S128-ni:1:10:20"
_FEATURES = "+simd128,+bulk-memory,+sign-ext,+nontrapping-fptoint"
_STACK = 1 << 16  # [bytes]
# numba's own optimiser would write this machine's vectors into the code; its cache may hold such.
# What a libm would be asked for: the gate's kernels ask it natively, here cpl.portable answers.
_LIBM = ("sin", "cos", "tan", "asin", "atan", "exp", "log")
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}  # as the kernels are compiled
# Where a kernel would raise, numba asks Python first: here it is the end.
_TRAP = """
declare void @llvm.trap()
define void @numba_gil_ensure(ptr %state) alwaysinline noreturn {
  call void @llvm.trap()
  unreachable
}
"""
_INLINED = "softfloat5fused"  # part of the mangled name
_PRIVATE = {
    "cpl_fma": (fused, types.float64(*[types.float64] * 3)),
    "cpl_fmod": (remainder, types.float64(*[types.float64] * 2)),
    **{name: (getattr(portable, name), types.float64(types.float64)) for name in _LIBM},
}
_SETTINGS = {
    "NUMBA_OPT": "0",
    "NUMBA_LOOP_VECTORIZE": "0",
    "NUMBA_SLP_VECTORIZE": "0",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
}


def build() -> bytes:
    """Compile and link the module, in a process of its own.

    Returns:
        The module.

    Raises:
        RuntimeError: If a step fails, or the module would need something from its host.
        ImportError: If the linker, the extra `wasm`, is not installed.
    """
    with tempfile.TemporaryDirectory() as folder:
        settings = {**os.environ, **_SETTINGS, "NUMBA_CACHE_DIR": f"{folder}/cache"}
        object_file = Path(folder) / "road.o"
        command = [sys.executable, "-m", "cpl.wasm.lower", str(object_file)]
        _run(command, settings)
        return _linked(object_file)


def lowered() -> tuple[bytes, list[str]]:
    """Return the object file for the linker and the names that it exports.

    Only a process with `build`'s settings gives code that another processor can run.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    head = f'target triple = "{_TRIPLE}"\ntarget datalayout = "{_LAYOUT}"\n'
    module = llvm.parse_assembly(head + _TRAP)
    wanted = {**EXPORTS, **_PRIVATE}
    for name, (function, signature) in wanted.items():
        plain = getattr(function, "py_func", function)
        compiled = cfunc(signature, **_OPTIONS)(plain)
        part = llvm.parse_assembly(_neutral(compiled.inspect_llvm(), compiled.native_name, name))
        for other in part.functions:
            if not other.is_declaration and other.name != name:
                other.linkage = "linkonce_odr"  # kernels that several exports call come once
        module.link_in(part)
    for function in module.functions:
        if not function.is_declaration and function.name not in EXPORTS:
            function.linkage = "internal"
            if _INLINED in function.name:
                function.add_function_attribute("alwaysinline")
    module.verify()
    machine = llvm.Target.from_triple(_TRIPLE).create_target_machine(opt=3, features=_FEATURES)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(module, passes)
    return machine.emit_object(module), list(EXPORTS)


def _neutral(text: str, native: str, name: str) -> str:
    """Rewrite one function's LLVM for no processor in particular, with our own arithmetic."""
    text = re.sub(r"target triple = .*", f'target triple = "{_TRIPLE}"', text)
    text = re.sub(r"target datalayout = .*", f'target datalayout = "{_LAYOUT}"', text)
    text = re.sub(r'"(target-cpu|target-features|tune-cpu|probe-stack)"="[^"]*"', "", text)
    text = text.replace("= common ", "= internal ").replace("noinline", "nounwind")
    text = text.replace("@llvm.fma.f64", "@cpl_fma")
    text = re.sub(rf"@llvm\.({'|'.join(_LIBM)})\.f64", r"@\1", text)
    operands = r"frem double ([^,]+), ([^\s,]+)"
    text, remainders = re.subn(operands, r"call double @cpl_fmod(double \1, double \2)", text)
    if remainders:
        text += "\ndeclare double @cpl_fmod(double, double)\n"
    return re.sub(rf'@"?{re.escape(native)}"?(?=\()', f"@{name}", text)


def _linked(object_file: Path) -> bytes:
    import ziglang  # pyright: ignore[reportMissingImports] - the extra wasm

    zig = Path(ziglang.__file__).parent / "zig"  # pyright: ignore[reportArgumentType]
    module = object_file.with_suffix(".wasm")
    names = object_file.with_suffix(".names").read_text().split()
    command = [
        str(zig), "wasm-ld", str(object_file), "-o", str(module), "--no-entry", "--strip-all",
        "--gc-sections", "-z", f"stack-size={_STACK}", "--stack-first",
        "--export=__heap_base", "--export-memory", *(f"--export={name}" for name in names),
    ]  # fmt: skip
    _run(command, dict(os.environ))
    return module.read_bytes()


def _run(command: list[str], settings: dict[str, str]) -> None:
    done = subprocess.run(command, env=settings, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:3])} ended with {done.returncode}:\n{done.stderr}")


if __name__ == "__main__":
    content, exported = lowered()
    target_file = Path(sys.argv[1])
    target_file.write_bytes(content)
    target_file.with_suffix(".names").write_text("\n".join(exported))
