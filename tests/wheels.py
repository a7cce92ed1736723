"""``python tests/wheels.py FOLDER``: looks into the wheels of a folder and the libraries in them.

A library may need of the system only what every one of that platform has, and all of them show
the same functions; a wheel holds the packages and nothing of tests, benchmarks or the paper.
"""

from __future__ import annotations

import io
import re
import sys
import zipfile
from pathlib import Path, PurePosixPath

import pefile
from elftools.elf.elffile import ELFFile
from macholib.MachO import MachO
from macholib.SymbolTable import SymbolTable

NEWEST_GLIBC = 2, 17
ON_ALL = {
    ".so": {"libc.so.6", "libm.so.6"},
    ".dylib": {"/usr/lib/libSystem.B.dylib"},
    ".dll": {"kernel32.dll", "ucrtbase.dll"},  # and the faces of the latter, api-ms-win-crt-*
}
PLACES = {"fem", "cms", "nldyn"}


def of_linux(content: bytes) -> tuple[set[str], set[str]]:
    """Libraries that an ELF library needs, and functions that it shows."""
    elf = ELFFile(io.BytesIO(content))
    needed = {tag.needed for tag in elf.get_section_by_name(".dynamic").iter_tags("DT_NEEDED")}
    versions = elf.get_section_by_name(".gnu.version_r").iter_versions()
    for version in {each.name for _, group in versions for each in group}:
        if tuple(map(int, version.removeprefix("GLIBC_").split(".")))[:2] > NEWEST_GLIBC:
            needed.add(version)
    symbols = elf.get_section_by_name(".dynsym").iter_symbols()
    return needed, {each.name for each in symbols if each["st_shndx"] != "SHN_UNDEF"}


def of_macos(path: Path) -> tuple[set[str], set[str]]:
    """The same of a Mach-O library."""
    library = MachO(str(path))
    [header] = library.headers
    shown = {name.decode() for _, name in SymbolTable(library, header).extdefsyms}
    needed = {name for _, _, name in header.walkRelocatables()}
    return needed, {name.removeprefix("_") for name in shown if not name.startswith("__")}


def of_windows(content: bytes) -> tuple[set[str], set[str]]:
    """The same of a PE library."""
    library = pefile.PE(data=content)
    names = {each.dll.decode().lower() for each in library.DIRECTORY_ENTRY_IMPORT}
    needed = {name for name in names if not name.startswith("api-ms-win-crt-")}
    return needed, {each.name.decode() for each in library.DIRECTORY_ENTRY_EXPORT.symbols}


def look_into(library: Path) -> tuple[set[str], set[str]]:
    """Libraries that a library needs, and functions that it shows."""
    if library.suffix == ".dylib":
        return of_macos(library)
    reader = of_linux if library.suffix == ".so" else of_windows
    return reader(library.read_bytes())


def wheel_libraries(wheel: Path, folder: Path) -> list[Path]:
    """The libraries of a wheel, taken out; the names of all its files are looked at."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        places = {PurePosixPath(name).parts[0] for name in names}
        strange = {place for place in places - PLACES if not place.endswith(".dist-info")}
        strange |= {name for name in names if re.search(r"(^|/)(tests?|bench|paper|hard)/", name)}
        if strange:
            raise SystemExit(f"{wheel.name} holds {', '.join(sorted(strange))}")
        found = [name for name in names if name.endswith(tuple(ON_ALL))]
        return [Path(archive.extract(name, folder / wheel.stem)) for name in found]


def main(folder: Path) -> None:
    """Look into all wheels."""
    wheels = sorted(folder.glob("*.whl"))
    sources = (Path(__file__).parents[1] / "nldyn" / "engine").glob("*.c")
    wanted = {
        name
        for source in sources
        for name in re.findall(r"^EXPORT [^(]*?(nldyn_\w+)\(", source.read_text("utf-8"), re.M)
    }
    for wheel in wheels:
        libraries = wheel_libraries(wheel, folder / "looked_into")
        if {each.stem for each in libraries} != {"engine"} | (
            {"enginev3"} if re.search("x86_64|amd64", wheel.name) else set()
        ):
            raise SystemExit(f"{wheel.name} has the libraries {[each.name for each in libraries]}")
        for library in libraries:
            needed, shown = look_into(library)
            if foreign := needed - ON_ALL[library.suffix]:
                raise SystemExit(f"{library} of {wheel.name} needs {', '.join(sorted(foreign))}")
            if shown != wanted:
                raise SystemExit(f"{library} of {wheel.name} lacks or has {shown ^ wanted}")
        size = wheel.stat().st_size / 1e6
        print(f"{wheel.name}: {size:.1f} MB, {len(libraries)} libraries, {len(wanted)} functions")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
