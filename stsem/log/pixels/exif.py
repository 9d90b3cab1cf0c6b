"""How a photograph is to be turned for viewing: the orientation tag of EXIF 2.3, table 4, tag 274."""

import struct

_MARK = b"Exif\0\0"
_TAG, _ENTRY = 0x0112, 12
UPRIGHT = 1


def orientation(head: bytes) -> int:
    """1 (as it stands) to 8; 1 where nothing is said.

    Args:
        head: the first few kilobytes of a JPEG file.
    """
    at = head.find(_MARK)
    if at < 0:
        return UPRIGHT
    tiff = head[at + len(_MARK) :]
    order = "<" if tiff[:2] == b"II" else ">"
    try:
        (directory,) = struct.unpack_from(f"{order}I", tiff, 4)
        (count,) = struct.unpack_from(f"{order}H", tiff, directory)
        for entry in range(count):
            tag, _, _, value = struct.unpack_from(f"{order}HHIH", tiff, directory + 2 + _ENTRY * entry)
            if tag == _TAG:
                return int(value) if 1 <= value <= 8 else UPRIGHT
    except struct.error:
        pass  # cut off or damaged: nothing is said
    return UPRIGHT
