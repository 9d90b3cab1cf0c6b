"""The table of formats: one row for each kind of data set or foreign recording that becomes an MCAP log."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stsem.convert import bags, camvid, cityscapes, icl_nuim, images, kitti_step, nice_slam, scannet, tum
from stsem.convert.recording import Options, Progress, Summary
from stsem.convert.write import dataset

Convert = Callable[[Path, Path, Options, Progress], Summary]
"""Source, file to write, options, progress. Raises a StsemError of one sentence and then leaves no file behind."""


@dataclass(frozen=True)
class Format:
    """One kind of source.

    Args:
        summary: what it is, in a few words, for the help.
        expects: what lies on disk, in a few words.
        detect: whether a path looks like one; cheap, and never raises.
        convert: writes it as a log. Of a data set, `dataset(read)`, where `read(source, options)` opens it as a
            `Recording` and raises ConversionError with one sentence when it cannot.
        last: whether it is looked at only when nothing else fits.
        several: whether a source may hold several recordings, so that one is chosen by name.
    """

    summary: str
    expects: str
    detect: Callable[[Path], bool]
    convert: Convert
    last: bool = False
    several: bool = False


FORMATS: dict[str, Format] = {
    "rosbag1": Format(
        "ROS 1 bag", "file.bag: plain, bz2 or lz4, indexed or not", bags.is_rosbag1, bags.convert_rosbag1
    ),
    "rosbag2": Format(
        "ROS 2 bag in sqlite3", "a folder of .db3 or .db3.zstd files", bags.is_rosbag2, bags.convert_rosbag2
    ),
    "tum": Format("TUM RGB-D", "rgb.txt, depth.txt, groundtruth.txt", tum.detect, dataset(tum.read)),
    "icl-nuim": Format(
        "ICL-NUIM, TUM-compatible",
        "associations.txt, rgb/, depth/, *.gt.freiburg",
        icl_nuim.detect,
        dataset(icl_nuim.read),
    ),
    "nice-slam": Format(
        "Replica as NICE-SLAM rendered it",
        "results/frame*.jpg, results/depth*.png, traj.txt, cam_params.json",
        nice_slam.detect,
        dataset(nice_slam.read),
    ),
    "scannet": Format(
        "ScanNet scan",
        "scene.sens, and label-filt/ with its table of classes",
        scannet.detect,
        dataset(scannet.read),
        several=True,
    ),
    "camvid": Format(
        "CamVid", "train/ and trainannot/, or 701_StillsRaw_full/", camvid.detect, dataset(camvid.read), several=True
    ),
    "cityscapes": Format(
        "Cityscapes sequences",
        "leftImg8bit_sequence/, gtFine/, camera/, disparity/",
        cityscapes.detect,
        dataset(cityscapes.read),
        several=True,
    ),
    "kitti-step": Format(
        "KITTI-STEP",
        "image_02/ and panoptic_maps/, calib/, poses/",
        kitti_step.detect,
        dataset(kitti_step.read),
        several=True,
    ),
    "images": Format(
        "a folder of images",
        "rgb/, depth/, labels/, poses.txt, classes.json, camera.json; or images alone",
        images.detect,
        dataset(images.read),
        last=True,
    ),
}
