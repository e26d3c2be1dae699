"""The file object under HDF5 while a result file is written."""

import io
from typing import Any


class Disk(io.RawIOBase):
    """The file under HDF5. The first write error is raised; later writes are dropped.

    HDF5's own file driver cannot close a file on a full disk: it retries until the process ends
    with a segmentation fault (seen with 1.10.8). Dropping writes lets it close; the file is then
    removed.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self.error: OSError | None = None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        count = self._file.readinto(view)
        view[count:] = bytes(len(view) - count)
        return len(view)

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        written = 0
        while written < len(view):
            written += self._attempt(self._file.write, view[written:]) or len(view)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        self._attempt(self._file.truncate, size)
        return self._file.seek(0, io.SEEK_END) if size is None else size

    def _attempt(self, call: Any, argument: Any) -> int | None:
        """The value of `call`; None once the disk has failed."""
        if self.error is not None:
            return None
        try:
            return call(argument)
        except OSError as error:
            self.error = error
            raise

    def close(self) -> None:
        self._file.close()
        super().close()
