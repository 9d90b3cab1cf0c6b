"""The table of checks: what the doctor may find, when, and what to do about it. `docs/logs.md` has the same rows."""

from stsem.log.doctor import parts, pictures, times
from stsem.log.doctor.finding import Check, Examined, Finding
from stsem.log.remark import Remark

CHECKS = (
    Check(
        "damage",
        "bytes are missing, broken, or contradict each other",
        "Copy the log again, or take the recorder's original; results are marked lossy and the exit code is 3.",
        parts.damage,
    ),
    Check(
        "undecodable",
        "messages are there, but cannot be used: their encoding, their size, their class table",
        "Mend what the reason names where it is recorded, or cut the log where it begins; if these are a few among "
        "many, copy the log again. Results are marked lossy and the exit code is 3.",
        parts.undecodable,
    ),
    Check(
        "unprotected",
        "messages stand under no checksum",
        "Record with chunk checksums (rosbag2: not with the preset fastwrite), or rewrite the log with `mcap recover`.",
        parts.unprotected,
    ),
    Check(
        "file-unfinished",
        "a folder holds a file that its recorder or a copy did not finish",
        "Give that file by name if it belongs to the recording, or remove it.",
    ),
    Check(
        "not-read",
        "the type of a channel is known, but not in its encoding, or its schema is broken",
        "Record the type in the encoding that is named; other channels are not affected.",
    ),
    Check(
        "video-codec",
        "a channel holds a video codec",
        "Record or convert it as jpeg, png or raw images if it is the camera that should be used.",
        pictures.video_codec,
    ),
    Check(
        "choice-unclear",
        "several channels have a claim to one role",
        "Say which with --topic ROLE=TOPIC.",
    ),
    Check(
        "image-dark",
        "more than half of the colour images are dark, or of one colour",
        "Look at the images; take the cap off, or choose another camera with --topic color=TOPIC.",
        pictures.image_dark,
    ),
    Check(
        "intrinsics-zero",
        "the calibration has a K of zeros",
        "Calibrate the camera and load the result in its driver; without, there is no map.",
    ),
    Check(
        "intrinsics-missing",
        "the only calibration is that of another camera",
        "Record the camera_info of the colour camera.",
    ),
    Check(
        "intrinsics-implausible",
        "numbers are not finite, or the field of view, the shape of the pixels or the principal point are those of no "
        "camera",
        "Check that the calibration is in pixels, of this camera, and of this image size.",
        pictures.intrinsics_implausible,
    ),
    Check(
        "intrinsics-shape",
        "the calibration is for images of another shape",
        "Record the calibration of the images that are sent; cropping belongs into its region of interest.",
    ),
    Check(
        "intrinsics-change",
        "the calibration changes during the log",
        "Cut the log where the lens or the mode of the camera changes.",
    ),
    Check(
        "distortion-unknown",
        "the model of the lens is unknown, or its numbers cannot be undone",
        "Record rectified images, or calibrate with plumb_bob, rational_polynomial or equidistant.",
    ),
    Check(
        "depth-unit",
        "half of the depth is nearer than 0.1 m or farther than 100 m",
        "Let the driver send 16 bits of millimetres or floats of metres, and record again: no flag mends it in a log.",
        pictures.depth_unit,
    ),
    Check(
        "depth-unknown",
        "more than 60 % of the pixels have no depth",
        "Check range, light and exposure of the depth camera; the map will have holes.",
        pictures.depth_unknown,
    ),
    Check(
        "depth-unregistered",
        "depth is not on the pixels of colour, and cannot be brought there",
        "Record depth aligned to colour, or both camera_info and the transform between the cameras; if it is aligned "
        "already, say --depth-registered yes.",
    ),
    Check(
        "depth-assumed",
        "depth is in another frame and of the same size, and nothing says how they lie to each other",
        "Say --depth-registered yes if depth is aligned to colour, no if it is not.",
    ),
    Check(
        "depth-undecodable",
        "no depth image can be decoded",
        "Record depth as 16UC1, 32FC1 or compressedDepth; jpeg spoils it.",
    ),
    Check(
        "depth-sparse",
        "fewer than 90 % of the frames have depth",
        "Record colour and depth at one rate, synchronised; without depth a frame adds nothing to the map.",
        parts.depth_sparse,
    ),
    Check(
        "pose-missing",
        "frames have no pose",
        "Record poses at 10 Hz or more, from before the first image until after the last.",
    ),
    Check(
        "pose-jumps",
        "the pose jumps farther than anything moves",
        "Use odometry, which does not jump (--topic pose=TOPIC), or expect a broken map there.",
    ),
    Check(
        "pose-still",
        "the pose does not change at all",
        "Check that localisation ran; take another channel with --topic pose=TOPIC.",
        parts.pose_still,
    ),
    Check(
        "pose-body-frame",
        "poses are those of a body (x forward, z up), and nothing says how the camera sits on it",
        "Record tf_static from the body to the camera's optical frame, and stamp the images with that frame.",
        parts.pose_body_frame,
    ),
    Check(
        "pose-tree",
        "the transforms do not lead to the camera, or in several ways",
        "Record tf and tf_static from their beginning, and give each frame one parent.",
    ),
    Check(
        "pose-static",
        "a static transform changes",
        "Let one node publish it, once; what moves belongs on tf.",
    ),
    Check(
        "pose-frames",
        "poses of one topic are in several frames",
        "Publish them in one frame, or record each on a topic of its own.",
    ),
    Check(
        "pose-values",
        "poses are not finite, not of unit length, or two of one time",
        "Mend the node that publishes them; what is no pose is left out.",
    ),
    Check(
        "pose-unreadable",
        "the channel that was asked for has no pose that can be read",
        "Take another with --topic pose=TOPIC.",
    ),
    Check(
        "map-impossible",
        "the log has no depth, no poses or no calibration",
        "Nothing, if no map is wanted (--map off); else record what is missing.",
        parts.map_impossible,
    ),
    Check(
        "truth-missing",
        "the log has no label images",
        "Nothing, if timing is what you want; else record images of class ids (mono8) with the stamps of colour.",
        parts.truth_missing,
    ),
    Check(
        "truth-other-camera",
        "the only label images are those of another camera",
        "Take that camera with --topic color=TOPIC, or record labels with the frame id of the colour images.",
    ),
    Check(
        "truth-shape",
        "label images have another shape than those of colour",
        "Record labels of the whole image; cut or fill them up by what is missing at each side.",
    ),
    Check(
        "truth-no-table",
        "there are label images, but no names of classes",
        "Give --classes FILE, or record the table as vision_msgs/LabelInfo.",
    ),
    Check(
        "truth-two-tables",
        "the log has several class tables, or one that changes",
        "Give the right one with --classes FILE.",
    ),
    Check(
        "truth-unknown-ids",
        "label images have ids or colours that the class table does not have",
        "Complete the table (--classes FILE); until then these pixels are not scored.",
    ),
    Check(
        "truth-sparse",
        "fewer than 90 % of the frames have truth",
        "Nothing, if only some frames were annotated; else check the stamps of the labels.",
        parts.truth_sparse,
    ),
    Check(
        "truth-inexact",
        "label images do not have the stamp of a colour image",
        "Give each label image the stamp of the image that it belongs to.",
    ),
    Check(
        "truth-ignored",
        "more than half of the truth is to be ignored",
        "Check the class table and the id that means ignore (255, or `ignore_id`).",
        parts.truth_ignored,
    ),
    Check(
        "truth-one-class",
        "next to all of the truth is of one class",
        "Check that the label images hold class ids and not a mask; any constant answer scores well here.",
        parts.truth_one_class,
    ),
    Check(
        "clock-offset",
        "log times are before their stamps, or more than a second behind",
        "Synchronise the clocks of sensor and recorder (chrony, PTP); the smallest offset is taken out.",
    ),
    Check(
        "clock-skew",
        "two channels run on two clocks, so that their images do not meet, or not the right ones",
        "Let one computer stamp both, or synchronise their clocks.",
    ),
    Check(
        "clock-reset",
        "a clock was set back",
        "Cut the log there; start recording after the clocks are synchronised.",
    ),
    Check(
        "clock-unstamped",
        "messages have no capture stamp",
        "Let the driver fill header.stamp; latency from the sensor is not known without.",
    ),
    Check(
        "clock-late",
        "the stamps of colour are equal to the log times",
        "Nothing, if the log was converted; else let the driver stamp at exposure: latency from the sensor looks too "
        "short.",
        times.clock_late,
    ),
    Check(
        "rate-uneven",
        "more than 5 % of the intervals between colour frames are off by half a period or more",
        "Check exposure (auto exposure stretches it), bandwidth and the recorder's queue; use a fixed frame rate.",
        times.rate_uneven,
    ),
    Check(
        "gaps",
        "colour frames pause for ten periods and a second",
        "Mend what stopped, as far as the finding tells; cut long pauses out with --start and --end.",
    ),
    Check(
        "duplicates",
        "colour images have one stamp",
        "Look for two publishers on one topic, or a log that was played into another.",
    ),
    Check("intrinsics-borrowed", "the calibration of depth, which is registered, serves for colour", ""),
    Check("intrinsics-scaled", "the calibration is for another size of the same shape", ""),
    Check("distortion-undone", "the lens distortion is undone", ""),
    Check("distortion-gone", "the images are rectified, so that no distortion is undone", ""),
    Check("depth-registered", "depth is brought onto the pixels of colour by calibrations and transforms", ""),
)
"""Those without anything to do, at the end, are notes."""


def examine(examined: Examined) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """(findings in the order of the table, notes)."""
    found = [finding for check in CHECKS for finding in check.findings(examined)]
    known = {check.name for check in CHECKS}
    others = [str(text) for text in examined.info.warnings if not (isinstance(text, Remark) and text.name in known)]
    notes = [finding.what for finding in found if not finding.do] + others
    return tuple(finding for finding in found if finding.do), tuple(notes)
