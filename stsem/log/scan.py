"""The first pass: one walk over the file or files of a log that leaves a compact index, and checks every checksum."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from stsem.log.container.damage import Damage
from stsem.log.container.files import File
from stsem.log.container.fingerprint import Fingerprint
from stsem.log.container.records import RecordWalk
from stsem.log.filescan import FileScan
from stsem.log.scanned import Scan
from stsem.plain import plain

__all__ = ["Scan", "scan"]

Progress = Callable[[int, int], None]
PROGRESS_BYTES = 1 << 20


def scan(files: Sequence[File], progress: Progress | None = None) -> Scan:
    """Walk over the files once; `progress` is called with (bytes done, bytes in all).

    Raises:
        LogError: a file is missing, empty, or not MCAP.
    """
    result, total, told = Scan(files, Damage()), sum(file.size for file in files), 0
    with Fingerprint() as fingerprint, ThreadPoolExecutor(1, "stsem-chunk") as worker:
        for file in files:
            with result.damage.within(plain(file.source.name) if len(files) > 1 else ""):
                if not file.size and total:  # what a recorder that crashed leaves of its last part
                    result.damage.count("truncated")
                    continue
                walk = RecordWalk(file.source, result.damage, fingerprint)
                one = FileScan(result, file, worker)
                for record in walk:
                    one.take(record)
                    if progress and fingerprint.bytes_fed >= told + PROGRESS_BYTES:
                        told = fingerprint.bytes_fed
                        progress(told, total)
                one.finish(data_has_crc=walk.data_has_crc, summary_is_right=walk.summary_is_right)
        if progress:
            progress(total, total)
        result.sha256 = fingerprint.hexdigest()
    return result
