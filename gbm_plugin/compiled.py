"""How and where the kernels are compiled: once for an installation and a kind of CPU, and found by every user.

`@kernel` marks what Python calls, `@part` what kernels call. Machine code is kept beside the package, where the
set-up puts it. Where the package cannot be written, it is still read from there; what is not there, for another
CPU, say, is kept in the user's cache folder, and without a home in a private temporary one, which is said.
NUMBA_CACHE_DIR overrules all. Code whose sources have changed, any in the kernel's own package, is compiled anew.
"""

from __future__ import annotations

import atexit
import hashlib
import logging
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from pickle import UnpicklingError

import numpy as np
from numba import config, njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.runtime import rtsys

log = logging.getLogger(__name__)

PACKAGE = Path(__file__).parent

# runs without Python's lock; divisions do not look for a zero, which would cost a branch each
part = njit(nogil=True, error_model="numpy")
inlined = njit(nogil=True, error_model="numpy", forceinline=True)
# without counting who refers to an array, which costs more than the little that these do: they make and return none
bare = njit(nogil=True, error_model="numpy", _nrt=False)
bare_inlined = njit(nogil=True, error_model="numpy", _nrt=False, forceinline=True)
woven = njit(nogil=True, error_model="numpy", inline="always")  # into the kernel, before types are known


@inlined
def part_of(share, shares, count):
    """First and last of the numbers below count that are this share's, where neighbours belong together."""
    return share * count // shares, (share + 1) * count // shares


def kernel(function=None, **options):
    """function compiled by Numba and kept; options as those of numba.njit."""
    if function is None:
        return lambda function: kernel(function, **options)
    dispatcher = njit(**{"nogil": True, "error_model": "numpy"} | options)(function)
    dispatcher._cache = _Folders(function)
    return dispatcher


def only_read(array: np.ndarray) -> np.ndarray:
    """A contiguous view that cannot be written: a kernel is made for one kind of array, whoever its owner is."""
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


class _Folders:
    """Numba's cache of a function in two folders: of the installation, and where that cannot be written the user's."""

    def __init__(self, function):
        self._function = function
        self._caches: dict[Path, FunctionCache] = {}

    def load_overload(self, signature, context):
        folders = [_shipped()] if _writable(_shipped()) else [_shipped(), _private()]
        for folder in folders:
            with suppress(OSError, EOFError, UnpicklingError):  # what cannot be read is made again
                if (code := self._cache(folder).load_overload(signature, context)) is not None:
                    return code
        _say_once()
        return None

    def save_overload(self, signature, code):
        folder = _shipped() if _writable(_shipped()) else _private()
        try:
            self._cache(folder).save_overload(signature, code)
        except OSError as error:
            log.warning("a compiled kernel cannot be kept in %s: %s", folder, error.strerror)

    def _cache(self, folder: Path) -> FunctionCache:
        if folder not in self._caches:
            self._caches[folder] = _in_folder(folder)(self._function)
        return self._caches[folder]


@lru_cache
def _say_once() -> None:
    log.info("compiling kernels for this kind of CPU, which is done once")


@lru_cache
def _in_folder(folder: Path) -> type[FunctionCache]:
    """Numba's cache of one function, in this folder."""

    class Locator(_CacheLocator):
        def __init__(self, function, file):
            self._function, self._file = function, Path(file)

        def get_cache_path(self):
            return str(folder)

        def get_source_stamp(self):
            return _stamp(self._file.parent)

        def get_disambiguator(self):
            return f"{self._file.parent.name}-{self._function.__code__.co_firstlineno}"

        @classmethod
        def from_function(cls, function, file):
            return cls(function, file)

    class Implementation(CompileResultCacheImpl):
        _locator_classes = (Locator,)

    class Cache(FunctionCache):
        _impl_class = Implementation

        def load_overload(self, signature, context):
            # what Numba would import here, to compile with, is most of a short run; code only needs its run time
            rtsys.initialize(context)
            return self._load_overload(signature, context)

    return Cache


@lru_cache
def _stamp(folder: Path) -> str:
    """Changes with any source of the package, and of the lanes: kernels hold the code of the parts that they call."""
    digest = hashlib.sha256()
    for path in (Path(__file__), PACKAGE / "simd.py", *sorted(folder.glob("*.py"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _shipped() -> Path:
    """The folder of the installation, or the one that the user chose for all."""
    return Path(config.CACHE_DIR) / "gbm" if config.CACHE_DIR else PACKAGE / "__pycache__" / "kernels"


@lru_cache
def _writable(folder: Path) -> bool:
    """Whether the folder is there, made if need be, and can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


@lru_cache
def _private() -> Path:
    """A folder of the user's own, where the installation cannot be written."""
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gbm"
    except RuntimeError:  # a user without a home
        home = None
    if home is not None and _writable(home):
        return home
    folder = Path(tempfile.gettempdir()) / f"gbm-{os.getuid()}"
    if not _own(folder):  # another user's: code must not come from there
        folder = Path(tempfile.mkdtemp(prefix="gbm-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    log.warning("compiled kernels are kept in %s: installation and home cannot be written", folder)
    return folder


def _own(folder: Path) -> bool:
    """Whether the folder, made if need be, is this user's, closed to all others, and no link."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
