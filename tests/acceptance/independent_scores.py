"""Scores of `--model oracle --keyframes every:5 --propagation hold --clock offline`, without a line of stsem.

python tests/acceptance/independent_scores.py LOG.mcap
"""

import json
import sys
from collections import defaultdict

import cv2
import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

INTERVAL, IGNORE = 5, 255


def truth_images(path: str) -> list[np.ndarray]:
    """Label images in order of their stamps (in both logs every frame has one, of exactly its stamp)."""
    found = []
    with open(path, "rb") as file:
        for decoded in make_reader(file, decoder_factories=[Ros2(), Protobuf()]).iter_decoded_messages(["/gt/labels"]):
            message = decoded.decoded_message
            if decoded.schema.name == "foxglove.CompressedImage":
                stamp = message.timestamp.seconds * 10**9 + message.timestamp.nanos
                pixels = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
            else:
                stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
                pixels = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width)
            found.append((stamp, pixels))
    return [pixels for _, pixels in sorted(found, key=lambda pair: pair[0])]


def score(truth: np.ndarray, answer: np.ndarray) -> dict[str, float]:
    """mIoU over the classes with truth pixels, and pixel accuracy; 255 in the answer is wrong everywhere."""
    truth, answer = truth[truth != IGNORE], answer[truth != IGNORE]
    ious = [((truth == c) & (answer == c)).sum() / ((truth == c) | (answer == c)).sum() for c in np.unique(truth)]
    return {"miou": sum(ious) / len(ious), "pixel_accuracy": (truth == answer).sum() / truth.size}


def scores(path: str) -> dict[str, object]:
    """The whole log, and by distance to the keyframe."""
    images = truth_images(path)
    answers = [images[i - i % INTERVAL] for i in range(len(images))]
    rows = defaultdict(list)
    for i in range(len(images)):
        rows[i % INTERVAL].append(i)
    of = {d: score(*(np.stack([x[i] for i in kept]) for x in (images, answers))) for d, kept in sorted(rows.items())}
    whole = score(np.stack(images), np.stack(answers))
    return {**whole, "by_distance": {str(d): row | {"n": len(rows[d])} for d, row in of.items()}}


if __name__ == "__main__":
    print(json.dumps(scores(sys.argv[1]), indent=2))
