"""`python -m cpl.wasm` makes `data/wasm/road.wasm` anew; the extra `wasm` brings the linker."""

import sys

from cpl.wasm import MODULE, make

if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit("usage: python -m cpl.wasm")
    sys.stdout.write(f"{MODULE}: {len(make())} bytes\n")
