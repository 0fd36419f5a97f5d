"""`simulate`: a log that `run` maps, with a truth that is true; odd plans and odd options."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.frame import Frame, Pose
from formats.opening import open_log
from formats.plans.file import open_plan
from formats.stream import survey
from replay import run, simulate
from replay.cli import _exit_code
from replay.simulator.casting import cast
from replay.simulator.options import DEFAULTS, RANGES
from replay.simulator.site import Site

ROOMS = ["#" * 40, *["#" + "." * 18 + "##" + "." * 18 + "#"] * 9, *["#" + "." * 38 + "#"] * 5]
ROOMS += [*["#" + "." * 18 + "##" + "." * 18 + "#"] * 9, "#" * 40]
YAML = "image: plan.png\nresolution: 0.02\norigin: [{}, {}, {}]\nnegate: 0\n"
YAML += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"


def write_plan(folder: Path, x: float = -1.03, y: float = 2.02, yaw: float = 0.0) -> Path:
    """8 x 5 m, two rooms with a gap between, 0.4 m of paper around; no wall on a cell's edge."""
    pixels = np.kron(
        np.array([[0 if c == "#" else 255 for c in row] for row in ROOMS]), np.ones((10, 10))
    )
    pixels = np.pad(pixels, 20, constant_values=255).astype(np.uint8)
    cv2.imwrite(str(folder / "plan.png"), pixels)
    (folder / "plan.yaml").write_text(YAML.format(x, y, yaw))
    return folder / "plan.png"


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the plan and a log of a drive through it."""
    folder = tmp_path_factory.mktemp("sim")
    simulate(write_plan(folder), folder / "sim.mcap", seconds=20.0, clutter=0.03)
    return folder


def frames(path: Path, **options: Any) -> list[Frame]:
    log = open_log(path, notes := Notes())
    found = list(survey(log, notes, **options).frames())
    log.close()
    assert not notes.total("skipped")
    return found


def test_run_maps_it_against_its_own_truth(home: Path) -> None:
    result = run(
        home / "sim.mcap",
        home / "plan.png",
        truth=f"{home / 'sim.mcap'}:/truth_map",
        output=home / "r.replay.mcap",
    )
    scores = result.facts["scores"]
    assert result.facts["scans"] == 201
    assert result.facts["skipped"] == 0
    assert scores["none"]["precision"] > 0.6
    assert scores["bayes"]["f2"] > scores["none"]["f2"] + 0.2


def test_the_truth_map_is_what_the_scans_see(home: Path) -> None:
    truth = Site.of_plan(open_plan(f"{home / 'sim.mcap'}:/truth_map", Notes()))
    plan = Site.of_plan(open_plan(home / "plan.png", Notes()))
    assert truth.geometry == pytest.approx(plan.geometry)
    assert (truth.solid & ~plan.solid).sum() > 50  # the clutter
    for frame in frames(home / "sim.mcap")[::20]:
        expected = cast(truth, frame.pose, frame.scan.bearings, 12.0)
        off = (frame.scan.ranges - expected)[np.isfinite(frame.scan.ranges)]
        assert np.median(np.abs(off)) < 0.012
        assert np.mean(np.abs(off) < 0.06) > 0.97
        assert np.abs(off.mean()) < 0.02


def test_the_plan_map_is_the_plan(home: Path) -> None:
    inside = open_plan(f"{home / 'sim.mcap'}:/plan_map", Notes())
    assert (inside.wall == open_plan(home / "plan.png", Notes()).wall).all()


def test_what_the_plan_does_not_know_stays_unknown(tmp_path: Path) -> None:
    pixels = cv2.imread(str(write_plan(tmp_path)), cv2.IMREAD_GRAYSCALE)
    assert pixels is not None
    pixels[:20] = pixels[-20:] = pixels[:, :20] = pixels[:, -20:] = 205  # the paper around
    cv2.imwrite(str(tmp_path / "plan.png"), pixels)
    simulate(tmp_path / "plan.png", tmp_path / "s.mcap", seconds=1.0)
    for topic in ("truth_map", "plan_map"):
        found = open_plan(f"{tmp_path / 's.mcap'}:/{topic}", Notes())
        assert (found.known == (pixels != 205)).all()
        assert (found.wall == (pixels == 0)).all()


def poses(path: Path, **options: Any) -> Any:
    return np.array([frame.pose for frame in frames(path, **options)])


def test_tf_and_the_truth_agree_and_odometry_drifts(home: Path) -> None:
    by_tf, truth = poses(home / "sim.mcap"), poses(home / "sim.mcap", pose="/ground_truth")
    assert truth[:, :2] == pytest.approx(by_tf[:, :2], abs=2e-3)
    assert np.cos(truth[:, 2] - by_tf[:, 2]) == pytest.approx(1.0, abs=1e-5)
    wheels = poses(home / "sim.mcap", pose="/odom")
    assert wheels[0] == pytest.approx([0.0, 0.0, 0.0], abs=0.01)
    first = Pose(*by_tf[0])
    moved = np.array([first @ Pose(*row) for row in wheels])
    errors = np.hypot(*(moved - by_tf)[:, :2].T)
    assert 0.0 < errors[-1] < 0.5
    assert errors[-50:].mean() > errors[:50].mean()


@pytest.mark.parametrize("name", ["again.mcap", "again.bag", "again"])
def test_every_container_has_the_same_drive_and_the_same_bytes_twice(
    name: str, home: Path, tmp_path: Path
) -> None:
    for path in (tmp_path / name, tmp_path / f"two{Path(name).suffix}"):
        simulate(home / "plan.png", path, seconds=20.0, clutter=0.03)
    one, two = frames(home / "sim.mcap"), frames(tmp_path / name)
    assert [f.time_ns for f in one] == [f.time_ns for f in two]
    for a, b in zip(one, two, strict=True):
        assert a.pose == b.pose
        assert np.array_equal(a.scan.ranges, b.scan.ranges, equal_nan=True)
    if name.endswith(".mcap"):
        assert (tmp_path / name).read_bytes() == (home / "sim.mcap").read_bytes()
    if name.endswith(".bag"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "two.bag").read_bytes()


def test_another_seed_is_another_drive(home: Path, tmp_path: Path) -> None:
    simulate(home / "plan.png", tmp_path / "x.mcap", seconds=20.0, clutter=0.03, seed=1)
    assert (tmp_path / "x.mcap").read_bytes() != (home / "sim.mcap").read_bytes()


def test_one_option_moves_no_other_draw(home: Path, tmp_path: Path) -> None:
    still = {"start": Pose(1.02, 4.53, 0.3), "metres": 0.0}
    for name, noise in (("a", 0.0), ("b", 0.2)):
        simulate(
            home / "plan.png", tmp_path / f"{name}.mcap", clutter=0.1, range_noise=noise, **still
        )
    a, b = (open_plan(f"{tmp_path / name}.mcap:/truth_map", Notes()).wall for name in "ab")
    assert (a == b).all()


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_a_plan_that_lies_elsewhere_in_the_map(yaw: float, tmp_path: Path) -> None:
    plan, offset = write_plan(tmp_path, yaw=yaw), Pose(5.0, -3.0, 0.7)
    facts = simulate(plan, tmp_path / "sim.mcap", plan_offset=offset, seconds=30.0)
    assert facts["plan_offset"] == [5.0, -3.0, 0.7]
    options: dict[str, Any] = {"truth": f"{tmp_path / 'sim.mcap'}:/truth_map"}
    found = run(
        tmp_path / "sim.mcap", plan, output=tmp_path / "r.mcap", plan_pose=offset, **options
    )
    assert found.facts["scores"]["none"]["precision"] > 0.85
    wrong = run(
        tmp_path / "sim.mcap",
        plan,
        output=tmp_path / "w.mcap",
        plan_pose=Pose(5.3, -3.0, 0.7),
        **options,
    )
    assert wrong.facts["scores"]["none"]["precision"] < 0.5


def test_waypoints_lead_through_the_gap(home: Path, tmp_path: Path) -> None:
    places = (Pose(0.5, 4.9, 0.0), Pose(6.4, 4.9, 0.0))
    facts = simulate(home / "plan.png", tmp_path / "w.mcap", waypoint=places)
    found = poses(tmp_path / "w.mcap", pose="/ground_truth")
    assert found[0][:2] == pytest.approx([0.5, 4.9], abs=0.1)
    assert found[-1][:2] == pytest.approx([6.4, 4.9], abs=0.1)
    assert 5.8 < facts["metres"] < 6.5


def test_walls_gone_and_collapsed(home: Path, tmp_path: Path) -> None:
    line = (3.4, 2.4, 3.4, 4.2)  # the wall between the rooms, to the south of the gap
    sizes = {}
    for what in ("remove_wall", "collapse_wall"):
        options: dict[str, Any] = {what: (line,)}
        facts = simulate(home / "plan.png", tmp_path / f"{what}.mcap", seconds=1.0, **options)
        truth = open_plan(f"{tmp_path / what}.mcap:/truth_map", Notes()).wall
        assert facts["gone"] > 0.3
        sizes[what] = int(truth.sum())
    plan = open_plan(home / "plan.png", Notes()).wall
    assert sizes["remove_wall"] < sizes["collapse_wall"] < plan.sum()


def test_no_clutter_stands_where_a_wall_was_drawn(home: Path, tmp_path: Path) -> None:
    def truth(**more: Any) -> Any:
        options: dict[str, Any] = {"seconds": 0.0, "deviation": 0.15, "force": True, **more}
        simulate(home / "plan.png", tmp_path / "d.mcap", **options)
        return open_plan(f"{tmp_path / 'd.mcap'}:/truth_map", Notes()).wall

    new = truth(clutter=0.15) & ~truth()
    assert new.sum() > 500
    assert not (new & open_plan(home / "plan.png", Notes()).wall).any()


def test_a_truth_picture_is_what_stands_there(home: Path, tmp_path: Path) -> None:
    pixels = cv2.imread(str(home / "plan.png"), cv2.IMREAD_GRAYSCALE)
    assert pixels is not None
    pixels[90:140, 90:140] = 0
    cv2.imwrite(str(tmp_path / "truth.png"), pixels)
    facts = simulate(
        home / "plan.png", tmp_path / "t.mcap", truth=tmp_path / "truth.png", seconds=1.0
    )
    assert facts["added"] == pytest.approx(50 * 50 * 0.02**2)
    cv2.imwrite(str(tmp_path / "small.png"), pixels[:-1])
    with pytest.raises(UsageError, match="440 x 289 pixels are not the plan's 440 x 290"):
        simulate(home / "plan.png", tmp_path / "s.mcap", truth=tmp_path / "small.png")


@pytest.mark.parametrize(
    ("kind", "topic"), [("sonar", "/range"), ("kinect", "/camera/depth/image_raw")]
)
def test_other_sensors_are_mapped(kind: str, topic: str, home: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"sensor": (kind,), "seconds": 10.0, "sensor_height": 0.5}
    facts = simulate(home / "plan.png", tmp_path / "k.mcap", **options)
    assert facts["topics"][topic] == (101 if kind == "sonar" else 51)
    result = run(tmp_path / "k.mcap", home / "plan.png", output=tmp_path / "r.mcap")
    assert result.facts["scans"] == facts["topics"][topic]
    assert result.facts["observed"]["bayes"]["f2"] > 0.5


def test_odometry_only_leaves_the_map_to_the_localiser(home: Path, tmp_path: Path) -> None:
    simulate(home / "plan.png", tmp_path / "o.mcap", localised=False, seconds=2.0)
    log = open_log(tmp_path / "o.mcap", notes := Notes())
    drive = survey(log, notes, pose="tf")
    assert drive.choice.source.map_frame == "odom"
    log.close()


def test_many_drives_at_once(home: Path, tmp_path: Path) -> None:
    facts = simulate(home / "plan.png", tmp_path / "d.mcap", count=3, metres=1.0)
    names = ["d-000.mcap", "d-001.mcap", "d-002.mcap"]
    assert sorted(p.name for p in tmp_path.iterdir()) == names
    assert [log["seed"] for log in facts["logs"]] == [2017, 2018, 2019]
    starts = {tuple(poses(tmp_path / name)[0].round(2)) for name in names}
    assert len(starts) == 3
    with pytest.raises(FormatError, match=r"d-000\.mcap: exists already"):
        simulate(home / "plan.png", tmp_path / "d.mcap", count=2)


def test_the_log_says_how_it_was_made(home: Path) -> None:
    from mcap.reader import make_reader

    with (home / "sim.mcap").open("rb") as file:
        [record] = list(make_reader(file).iter_metadata())
    about = json.loads(record.metadata["simulation"])
    assert about["plan"] == "plan.png"
    assert (about["seconds"], about["clutter"], about["seed"]) == (20.0, 0.03, 2017)


# Plans in which nobody can drive.


def odd_plan(folder: Path, pixels: np.ndarray[Any, np.dtype[np.uint8]]) -> Path:
    cv2.imwrite(str(folder / "plan.png"), pixels)
    (folder / "plan.yaml").write_text(YAML.format(0, 0, 0))
    return folder / "plan.png"


GREY = np.full((40, 40), 255, dtype=np.uint8)
NARROW = np.tile(np.array([255, 255, 0], dtype=np.uint8), (40, 14))


@pytest.mark.parametrize(
    ("pixels", "problem"),
    [
        (NARROW, "no room for a robot of radius 0.2 m"),
        (GREY * 0, "every pixel is black"),
        (GREY, "every pixel is white"),
        (GREY[:1, :1] * 0, "every pixel is black"),
        (np.array([[0, 255]], dtype=np.uint8), "no room for a robot"),
    ],
    ids=["narrow", "black", "white", "one", "two"],
)
def test_plans_without_room(pixels: Any, problem: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=problem.replace(".", r"\.")):
        simulate(odd_plan(tmp_path, pixels), tmp_path / "x.mcap")
    assert not (tmp_path / "x.mcap").exists()


def test_a_plan_without_a_scale(home: Path, tmp_path: Path) -> None:
    (tmp_path / "bare.png").write_bytes((home / "plan.png").read_bytes())
    with pytest.raises(UsageError, match="give --plan-resolution"):
        simulate(tmp_path / "bare.png", tmp_path / "x.mcap")
    simulate(tmp_path / "bare.png", tmp_path / "x.mcap", plan_resolution=0.02, seconds=1.0)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"start": Pose(-0.5, 2.5, 0.0)}, "there is no room for the robot; the nearest free"),
        ({"start": Pose(99.0, 2.5, 0.0)}, "lies outside the plan"),
        ({"waypoint": (Pose(1.0, 4.0, 0), Pose(-0.9, 2.1, 0))}, "there is no room for the robot"),
        ({"robot_radius": 0.6, "waypoint": (Pose(1, 4, 0), Pose(6, 4, 0))}, "no way leads from"),
        ({"robot_radius": 5.0}, "no room for a robot of radius 5 m"),
        ({"remove_wall": ((0.0, 4.0, 1.0, 4.0),)}, "no wall lies within"),
        ({"sensor": ("radar",)}, "no such sensor; there are lidar, sonar, kinect"),
        ({"sensor": ()}, "no such sensor"),
        ({"start": Pose(1, 4, 0), "random_start": True}, "exclude each other"),
        ({"min_range": 5.0, "range": 2.0}, "--min-range 5 is not below --range 2"),
        ({"rate": 1e4, "laps": 10_000}, "are too many"),
        ({"wheels": 4}, "there is no option wheels"),
    ],
)
def test_odd_wishes(options: dict[str, Any], problem: str, home: Path, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=problem):
        simulate(home / "plan.png", tmp_path / "x.mcap", **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [float("nan"), -1e300, 1e300])
@pytest.mark.parametrize("name", list(RANGES))
def test_numbers_out_of_range(name: str, value: float, home: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {name: value}
    with pytest.raises(UsageError, match=f"--{name.replace('_', '-')} .* is not from"):
        simulate(home / "plan.png", tmp_path / "x.mcap", **options)


def test_a_robot_that_stands(home: Path, tmp_path: Path) -> None:
    for name, budget in (("m", {"metres": 0.0}), ("s", {"seconds": 0.0})):
        facts = simulate(home / "plan.png", tmp_path / f"{name}.mcap", **budget)
        assert (facts["metres"], facts["readings"]) == (0.0, 1)
        assert len(frames(tmp_path / f"{name}.mcap")) == 1


def test_the_command_line_has_every_option(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _exit_code(["simulate", "--help"]) == 0
    text = capsys.readouterr().out
    hidden = {"localised"}
    missing = [n for n in DEFAULTS if f"--{n.replace('_', '-')}" not in text and n not in hidden]
    assert missing == []
    command = ["simulate", str(home / "plan.png"), "-o", str(tmp_path / "c.mcap")]
    assert (
        _exit_code([*command, "--metres", "1", "--remove-wall", "3.4,2.4,3.4,4.2", "--json"]) == 0
    )
    facts = json.loads(capsys.readouterr().out)
    assert facts["schema"] == 1
    assert facts["gone"] > 0.3
    assert _exit_code([*command, "--remove-wall", "1,2,3", "--force"]) == 2
    assert "is not X0,Y0,X1,Y1" in capsys.readouterr().err
    assert _exit_code([*command[:2], "-o", str(tmp_path / "c.db3")]) == 2
