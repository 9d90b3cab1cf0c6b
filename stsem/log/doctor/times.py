"""Checks of stamps and rates."""

from collections.abc import Iterator

import numpy as np

from stsem.log.doctor.finding import Examined

UNEVEN_BY = 0.5
"""Of the period: an interval that is longer or shorter by half of it ..."""
UNEVEN_SHARE = 0.05
"""... and one in twenty like that is more than a camera that drops an image now and then."""
MIN_INTERVALS = 10


def rate_uneven(seen: Examined) -> Iterator[str]:
    """Colour frames at uneven intervals; repeated stamps are said elsewhere."""
    steps = np.diff(seen.stamps_ns)
    steps = steps[steps > 0]
    if len(steps) < MIN_INTERVALS:
        return
    period = float(np.median(steps))
    uneven = int((np.abs(steps - period) > UNEVEN_BY * period).sum())
    if uneven <= UNEVEN_SHARE * len(steps):
        return
    low, high = np.percentile(steps, (5, 95)) / 1e6
    yield (
        f"{uneven} of {len(steps)} intervals between colour frames are not within half of their median of "
        f"{period / 1e6:.1f} ms (5 % below {low:.1f} ms, 5 % above {high:.1f} ms)."
    )


def clock_late(seen: Examined) -> Iterator[str]:
    """Stamps that were made when the message was recorded."""
    for channel in seen.info.channels:
        exact = channel.offset_min_ns == channel.offset_max_ns == 0
        if channel.role == "color" and channel.count > 1 and exact and channel.unstamped == 0:
            yield (
                f"All {channel.count} stamps of {channel.topic} are equal to their log times: they were made by the "
                "driver or the recorder when the image was sent, or by a conversion, not when the sensor looked."
            )
