"""Which channels are one camera: what is chosen within it, and whose depth and labels are used."""

from pathlib import Path

import pytest
from channel_kinds import record

from stsem.errors import ChannelError
from stsem.log.log import open_log


@pytest.mark.parametrize("labels", ["/rear/semantic", "/gt/labels"])
@pytest.mark.parametrize("frame", ["rear", "odd"])
def test_labels_of_another_camera_are_used_only_when_asked_for(tmp_path: Path, labels: str, frame: str) -> None:
    """Told by the frame, else by the topic; labels that nothing ties to a camera are used."""
    topics = {"/front/image": "rgb@front", "/rear/image": "jpeg@rear", labels: f"labels@{frame}", "/names": "names"}
    path = record(tmp_path / "log.mcap", topics)
    with open_log([path], topics={"color": "/front/image"}) as log:
        untied = (labels, frame) == ("/gt/labels", "odd")
        assert log.info.choice.labels == (labels if untied else None)
        assert any(f"{labels} (frame {frame!r}) belongs to /rear/image and not to /front/image" in text
                   for text in log.info.warnings) is not untied  # fmt: skip
    for asked in ({"color": "/front/image", "labels": labels}, {"color": "/rear/image"}):
        with open_log([path], topics=asked) as log:
            assert log.info.choice.labels == labels


REASONS = {
    "only one": {"/cam/image": "rgb"},
    "in colour": {"/cam/image_color": "rgb", "/cam/image_mono": "mono"},
    "rectified": {"/cam/image_rect": "rgb", "/cam/image_raw": "rgb"},
    "compressed": {"/cam/image_raw": "rgb", "/cam/image_raw/compressed": "jpeg"},
    "neither infrared nor painted": {"/cam/image": "mono", "/infra1/image": "mono"},
    "by its name": {"/rgb/image": "rgb", "/front/image": "rgb"},
}


@pytest.mark.parametrize("why", REASONS)
def test_the_reason_is_what_decided(tmp_path: Path, why: str) -> None:
    with open_log([record(tmp_path / "log.mcap", REASONS[why])]) as log:
        assert log.info.reasons["color"] == why


def test_resolutions_of_one_camera_are_listed_in_colour(tmp_path: Path) -> None:
    """No size is better than another; what is grey is no rival."""
    topics = {f"/k/{size}/image_{kind}": message for size, color in (("hd", "rgb"), ("sd", "small"))
              for kind, message in (("color", color), ("mono", "mono"))}  # fmt: skip
    with pytest.raises(ChannelError) as caught:
        open_log([record(tmp_path / "log.mcap", topics)])
    assert caught.value.rivals == ("/k/hd/image_color", "/k/sd/image_color")


def test_two_eyes_are_listed_unless_one_is_sent_twice(tmp_path: Path) -> None:
    """Equal frame ids of two devices do not make them one."""
    eyes = {"/zed/left/image": "rgb@left", "/zed/right/image": "rgb@right"}
    others = {"/front/rgb/image": "rgb@camera", "/rear/rgb/image": "rgb@camera"}
    for name, topics in (("eyes", eyes), ("devices", others)):
        with pytest.raises(ChannelError) as caught:
            open_log([record(tmp_path / f"{name}.mcap", topics)])
        assert caught.value.rivals == tuple(topics)


def test_the_colour_camera_cannot_be_something_else(tmp_path: Path) -> None:
    path = record(tmp_path / "log.mcap", {"/cam": "rgb", "/infra1": "mono", "/rear/jpeg": "jpeg"})
    alone = record(tmp_path / "alone.mcap", {"/cam": "rgb", "/infra1": "mono"})
    for role in ("depth", "labels"):
        with pytest.raises(ChannelError, match=rf"^/cam was given for {role}, but it is the colour camera \(rgb8\)"):
            open_log([alone], topics={role: "/cam"})
    with pytest.raises(ChannelError, match=r"^/cam was given for depth, but it holds rgb8: depth needs 16 bits"):
        open_log([path], topics={"depth": "/cam"})
    with pytest.raises(ChannelError, match=r"but it holds jpeg: labels need a lossless image"):
        open_log([path], topics={"labels": "/rear/jpeg", "color": "/cam"})
