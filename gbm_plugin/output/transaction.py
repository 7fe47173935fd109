"""Changes to an HDF5 file that happen completely or not at all.

HDF5 changes its metadata in place, in an order of its own: a process that dies, or a disk that fills, in the
middle of a write can leave a file that no longer opens. Here HDF5 writes into memory instead, and the result
is published in three moves:

1. what is new goes behind the end of the file, followed by a journal: the changed pages and a checksum;
2. the changed pages are written to their places;
3. the journal is cut off.

Interrupted in 1, the file is the old one with unused bytes at its end, which HDF5 permits; a full disk shows
itself only here. Interrupted in 2 or 3, the journal is complete and whoever opens the file reads through it.
The promise holds for the death of the process, not for the loss of power.
"""

from __future__ import annotations

import errno
import io
import os
import struct
import zlib
from pathlib import Path

PAGE = 4096
_FOOTER = struct.Struct("<QQI8s")  # end of the HDF5 file, changed pages, checksum, magic
_MAGIC = b"gbmJrnl1"
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


class FileFullError(OSError):
    """No room for the change; the file is as it was before."""


class Transaction(io.RawIOBase):
    """A file object for ``h5py.File``: the file at `path` as it is, plus changes held in memory."""

    def __init__(self, path: Path | str, *, writable: bool) -> None:
        super().__init__()
        self._fd = os.open(path, (os.O_RDWR | os.O_NOFOLLOW) if writable else os.O_RDONLY)
        self._base = os.fstat(self._fd).st_size  # bytes below are pages of the file, above is new
        self._pages: dict[int, bytearray] = {}
        self._new = bytearray()
        self._position = 0
        self._recover()
        if writable and self._pages:
            self._apply()

    def _recover(self) -> None:
        """Take over the journal of an interrupted publication, if there is one."""
        footer = os.pread(self._fd, _FOOTER.size, max(self._base - _FOOTER.size, 0))
        if len(footer) < _FOOTER.size:
            return
        end, count, checksum, magic = _FOOTER.unpack(footer)
        if magic != _MAGIC or end + count * (8 + PAGE) + _FOOTER.size != self._base:
            return
        journal = os.pread(self._fd, count * (8 + PAGE), end)
        if zlib.crc32(journal) != checksum:
            return
        self._base = end
        for start in range(0, len(journal), 8 + PAGE):
            number = int.from_bytes(journal[start : start + 8], "little")
            self._pages[number] = bytearray(journal[start + 8 : start + 8 + PAGE])

    @property
    def recovered(self) -> bool:
        """Whether there are pages here that the file itself lacks."""
        return bool(self._pages)

    # --- the file object that HDF5 sees -------------------------------------------------------------------

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._base + len(self._new)}
        self._position = origin[whence] + offset
        return self._position

    def readinto(self, buffer) -> int:
        target = memoryview(buffer).cast("B")
        first, last = self._position, min(self._position + len(target), self._base + len(self._new))
        old = min(last, self._base)
        if first < old:
            target[: old - first] = os.pread(self._fd, old - first, first)
            for number in range(first // PAGE, (old - 1) // PAGE + 1) if self._pages else ():
                if number in self._pages:
                    low, high = max(first, number * PAGE), min(old, (number + 1) * PAGE)
                    page = self._pages[number]
                    target[low - first : high - first] = page[low - number * PAGE : high - number * PAGE]
        if last > max(first, self._base):
            low = max(first, self._base)
            target[low - first : last - first] = self._new[low - self._base : last - self._base]
        self._position = max(first, last)
        return max(last - first, 0)

    def write(self, buffer) -> int:
        data = memoryview(buffer).cast("B")
        first, last = self._position, self._position + len(data)
        old = min(last, self._base)
        for number in range(first // PAGE, (old - 1) // PAGE + 1) if first < old else ():
            start = number * PAGE
            if number not in self._pages:
                self._pages[number] = bytearray(os.pread(self._fd, PAGE, start).ljust(PAGE, b"\0"))
            low, high = max(first, start), min(old, start + PAGE)
            self._pages[number][low - start : high - start] = data[low - first : high - first]
        if last > self._base:
            low = max(first, self._base)
            self._new.extend(bytes(max(low - self._base - len(self._new), 0)))
            self._new[low - self._base : last - self._base] = data[low - first :]
        self._position = last
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        size = self._position if size is None else size
        wanted = max(size - self._base, 0)  # a file longer than HDF5 needs is permitted
        del self._new[wanted:]
        self._new.extend(bytes(wanted - len(self._new)))
        return size

    def close(self) -> None:
        if not self.closed:
            os.close(self._fd)
        super().close()

    # --- publication ----------------------------------------------------------------------------------------

    def publish(self) -> None:
        """Put the changes into the file.

        Raises FileFullError, with the file as before, if the disk, the quota or the limit on the file's size
        leaves no room.
        """
        end = self._base + len(self._new)
        number, used = divmod(self._base, PAGE)
        if number in self._pages:  # the page that the file's old end divides
            rest = bytes(self._new[: PAGE - used])
            self._pages[number][used : used + len(rest)] = rest
        journal = b"".join(number.to_bytes(8, "little") + page for number, page in self._pages.items())
        footer = _FOOTER.pack(end, len(self._pages), zlib.crc32(journal), _MAGIC)
        try:
            for offset, data in ((self._base, self._new), (end, journal + footer)):
                _write_all(self._fd, data, offset)
        except OSError as error:
            os.ftruncate(self._fd, self._base)
            if error.errno not in _FULL:
                raise
            needed = len(self._new) + len(journal) + len(footer)
            raise FileFullError(
                error.errno,
                f"no room for {needed} more bytes ({os.strerror(error.errno).lower()})",
            ) from None
        self._base, self._new = end, bytearray()
        self._apply()

    def _apply(self) -> None:
        """Write the changed pages to their places and cut off the journal."""
        for number, page in self._pages.items():
            _write_all(self._fd, page[: self._base - number * PAGE], number * PAGE)
        os.ftruncate(self._fd, self._base)
        self._pages = {}


def _write_all(fd: int, data: bytes | bytearray, offset: int) -> None:
    view = memoryview(data)
    while view:
        written = os.pwrite(fd, view, offset)
        view, offset = view[written:], offset + written
