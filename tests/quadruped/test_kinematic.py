"""The twin, shrunken: each part against something known, then three seconds of the whole."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cpl.quadruped import (
    GainLimits,
    Policy,
    PolicyConfig,
    constant_gain,
    corrected_gain,
    run,
    shape,
)
from cpl.quadruped.kinematic import (
    Body,
    FisheyeCamera,
    KinematicWorld,
    OdometryConfig,
    Room,
    SlamError,
    WorldConfig,
)
from cpl.quadruped.kinematic.body import DT, GRAVITY, STATE, SUBSTEPS, feel, walk
from cpl.quadruped.kinematic.camera import project
from cpl.quadruped.kinematic.estimate import angles, predict, refine
from cpl.quadruped.kinematic.render import cast_depth, expose
from cpl.quadruped.kinematic.room import textures

BRIGHT = WorldConfig()
LOOK = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # camera axes of a body that looks along +x


def turned(vector):
    return cv2.Rodrigues(np.array(vector, dtype=float))[0]


def strides(command, steps, body, noise=0.0, seed=0):
    """Return the camera poses of some policy steps and the last state."""
    rng, state, reach = np.random.default_rng(seed), np.zeros(STATE), np.array([4.0, 4.0])
    poses = []
    for _ in range(steps):
        block = np.empty((SUBSTEPS, 12))
        draws = noise * rng.standard_normal((SUBSTEPS, 5))
        walk(state, np.array(command, dtype=float), body.vector, reach, draws, block)
        poses.append(block)
    return np.concatenate(poses), state


def test_the_lens_agrees_with_opencv():
    camera = FisheyeCamera()
    points = np.random.default_rng(0).normal((0, 0, 3), 1, size=(50, 3))
    f, c_x, c_y, *k = camera.intrinsics
    matrix = np.array([[f, 0, c_x], [0, f, c_y], [0, 0, 1]])
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), matrix, np.array(k)
    )
    np.testing.assert_allclose(project(camera.intrinsics, points), expected[:, 0], atol=1e-9)


def test_a_pixel_and_its_ray_belong_together():
    camera = FisheyeCamera()
    inside, rays = camera.pixel_rays
    uv = project(camera.intrinsics, rays.astype(float))
    np.testing.assert_allclose(uv @ [1, camera.width], inside, atol=0.05)


def test_distances_in_the_box_by_hand():
    pose = np.concatenate([[1.0, 0.0, 1.0], LOOK.ravel()])
    rays = np.array([[0.0, 0, 1], [0, 1, 0], [0, -1, 0], [1, 0, 0]])  # ahead, down, up, right
    distances = cast_depth(Room(half_x_m=4.5, half_y_m=4.0).box, pose, rays)
    np.testing.assert_allclose(distances, [3.5, 1.0, 2.0, 4.0])


def picture(yaw=0.0, electrons=1e9, subs=1, read_noise=0.0):
    camera, room = FisheyeCamera(), Room()
    inside, rays = camera.pixel_rays
    poses = np.array(
        [np.r_[0, 0, 0.35, (turned([0, 0, yaw + 0.03 * j]) @ LOOK).ravel()] for j in range(subs)]
    )
    image = np.zeros(camera.width * camera.height, dtype=np.uint8)
    noise = np.random.default_rng(1).standard_normal(2**16).astype(np.float32)
    texture = textures(room, np.random.default_rng(0))
    expose(texture, room.box, rays, inside, poses, electrons, read_noise, noise, 0, image)
    return image.reshape(camera.height, camera.width)[60:140, 60:150].astype(float)


def test_the_picture_moves_as_the_lens_says():
    """Turning left by one pixel's angle at the centre moves the picture right by one pixel."""
    shift, _ = cv2.phaseCorrelate(picture(0.0), picture(4 / 71.5))
    assert shift[0] == pytest.approx(4.0, abs=0.3)
    assert shift[1] == pytest.approx(0.0, abs=0.2)


def test_blur_takes_contrast_and_dim_light_adds_noise():
    gradient = [np.abs(np.diff(picture(subs=n), axis=1)).mean() for n in (1, 6)]
    assert gradient[1] < 0.6 * gradient[0]
    noise = [np.std(picture(electrons=e) - picture()) for e in (4e4, 1e4)]
    assert noise[1] == pytest.approx(2 * noise[0], rel=0.1)  # shot noise: one over the root


def test_a_steady_walk_by_hand():
    """After many time constants the robot goes as told; standing, it does not shake."""
    smooth = replace(Body(), slip=0.0)
    _, state = strides((0.5, 0.0, 0.0), 30, smooth)
    assert state[3] == pytest.approx(0.5, rel=1e-4)
    assert state[0] == pytest.approx(0.5 * (3.0 - smooth.lag_s), rel=0.01)
    still, _ = strides((0.0, 0.0, 0.0), 5, smooth)
    assert np.ptp(still, axis=0).max() == 0.0
    heads = [strides((v, 0, 0), 30, smooth)[0][-240:, 2] for v in (0.4, 0.8)]
    assert np.ptp(heads[1]) == pytest.approx(2 * np.ptp(heads[0]), rel=0.15)


def test_a_wall_stops_the_robot():
    state, block = np.zeros(STATE), np.empty((SUBSTEPS, 12))
    args = (Body().vector, np.array([0.1, 4.0]), np.zeros((SUBSTEPS, 5)), block)
    touched = [walk(state, np.array([1.0, 0.0, 0.0]), *args) for _ in range(10)]
    assert touched[-1]
    assert state[0] == pytest.approx(0.1)


def test_imu_and_prediction_undo_each_other():
    """Without noise the strapdown prediction follows the true camera."""
    poses, _ = strides((0.8, 0.2, 1.0), 10, Body(), noise=1.0)
    n = len(poses)
    gyro, accel = np.empty((n, 3)), np.empty((n, 3))
    before = np.repeat(poses[:1], 2, axis=0)
    feel(before, poses, np.zeros(6), np.zeros((n, 6)), 0.0, 0.0, gyro, accel)
    np.testing.assert_allclose(accel[0], poses[0, 3:].reshape(3, 3).T @ [0, 0, GRAVITY])
    position, velocity = poses[0, :3].copy(), np.zeros(3)
    rotation = np.ascontiguousarray(poses[0, 3:].reshape(3, 3))
    predict(position, velocity, rotation, gyro, accel)
    np.testing.assert_allclose(position, poses[-1, :3], atol=0.01)
    np.testing.assert_allclose(rotation, poses[-1, 3:].reshape(3, 3), atol=0.01)
    np.testing.assert_allclose(velocity, (poses[-1, :3] - poses[-2, :3]) / DT, atol=0.05)


def test_refinement_finds_the_pose():
    rng = np.random.default_rng(0)
    points = rng.uniform((2, -3, -3), (8, 3, 3), size=(40, 3))
    rotation, position = turned([0.1, -0.2, 0.3]) @ LOOK, np.array([0.3, -0.1, 0.2])
    local = (points - position) @ rotation
    rays = local / np.linalg.norm(local, axis=1)[:, None]
    found_p, found_r = position + 0.1, np.ascontiguousarray(turned([0.02, 0.03, -0.02]) @ rotation)
    refine(found_p, found_r, points, rays, 0.01)
    np.testing.assert_allclose(found_p, position, atol=1e-4)
    np.testing.assert_allclose(found_r, rotation, atol=1e-4)
    assert angles(found_p, found_r, points, rays).max() < 1e-4


def drive(world, seconds, command=(0.5, 0.0, 0.3), seed=0):
    seen = [world.reset((0.0, 0.0, 0.0), seed)]
    seen += [world.step(command) for _ in range(round(10 * seconds))]
    return seen


def test_in_good_light_the_odometry_holds_for_three_seconds():
    seen = drive(KinematicWorld(BRIGHT), 3.0)
    assert {o.slam_error for o in seen} == {0}
    drift = np.subtract(seen[-1].pose, seen[-1].true_pose)
    assert np.hypot(*drift[:2]) < 0.15
    assert abs(drift[2]) < 0.05
    quaternions = np.array([o.quaternion for o in seen])
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(
        [2 * np.arctan2(q[2], q[3]) for q in quaternions], [o.yaw for o in seen], atol=0.02
    )


def test_the_same_seed_gives_the_same_run_and_another_does_not():
    world = KinematicWorld(BRIGHT)
    first = drive(world, 0.6, seed=3)
    assert drive(world, 0.6, seed=3) == first
    assert drive(KinematicWorld(BRIGHT), 0.6, seed=3) == first
    assert drive(world, 0.6, seed=4) != first


def test_a_fork_has_the_same_future_and_leaves_the_present_alone():
    world = KinematicWorld(BRIGHT)
    drive(world, 0.5)
    fork = world.fork()
    futures = [[w.step((0.6, 0.0, -0.5)) for _ in range(5)] for w in (fork, world)]
    assert futures[0] == futures[1]


def test_a_bare_wall_gives_the_code_vision():
    bare = replace(BRIGHT, room=Room(richness=0.0))
    assert {o.slam_error for o in drive(KinematicWorld(bare), 0.5)[1:]} == {SlamError.VISION}


def test_spinning_in_the_dark_gives_the_code_speed():
    dim = replace(
        BRIGHT, room=Room(richness=0.5, light=0.05), camera=FisheyeCamera(exposure_s=0.03)
    )
    seen = drive(KinematicWorld(dim), 1.5, command=(1.0, 0.0, 3.5))
    assert SlamError.SPEED in {o.slam_error for o in seen}
    lost = [o for o in seen if o.confidence == 0]
    assert all(o.slam_error != 0 for o in lost)


def test_a_lost_robot_finds_itself_again():
    """Blind for 0.2 s (the odometry is handed black pictures), then it recognises the place."""
    world = KinematicWorld(BRIGHT)
    drive(world, 1.0, command=(0.2, 0.0, 0.0))
    photograph = world._photograph
    world._photograph = lambda poses: np.zeros_like(photograph(poses))
    blind = [world.step((0.2, 0.0, 0.0)) for _ in range(2)]
    world._photograph = photograph
    seeing = [world.step((0.2, 0.0, 0.0)) for _ in range(3)]
    assert [o.slam_error != 0 for o in blind] == [True, True]
    assert [o.confidence for o in blind] == [0, 0]
    assert [o.slam_error for o in seeing[1:]] == [0, 0]
    assert np.hypot(*np.subtract(seeing[-1].pose, seeing[-1].true_pose)[:2]) < 0.1


def test_a_run_of_the_whole_and_an_oracle_in_it():
    limits = GainLimits(kp_min=0.8, kp_max=4.0)
    rows = []
    for policy in (
        Policy(constant_gain, limits, PolicyConfig()),
        Policy(corrected_gain, limits, PolicyConfig(), oracle=True),
    ):
        generator = run(KinematicWorld(BRIGHT), shape("triangle"), policy, None, 0)
        rows.append([next(generator) for _ in range(8)])
    assert {row["slam_error"] for run_rows in rows for row in run_rows} == {0}
    assert rows[1][-1]["kp"] == pytest.approx(1.5 * 1.1**8)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Room(light=0), r"light must be in \(0, inf\), got 0"),
        (lambda: Room(richness=2), r"richness must be in \[0, 1\], got 2"),
        (lambda: Room(floor_half_width_m=9), "floor_half_width_m .* got 9"),
        (lambda: FisheyeCamera(exposure_s=-1), r"exposure_s must be in \(0, inf\), got -1"),
        (lambda: FisheyeCamera(read_noise=-1), "read_noise .* got -1"),
        (lambda: Body(lag_s=0), r"lag_s must be in \(0, inf\), got 0"),
        (lambda: Body(slip=-1), "slip .* got -1"),
        (lambda: OdometryConfig(features=0), "features .* got 0"),
        (lambda: OdometryConfig(min_features=3), r"min_features must be in \[6, inf\), got 3"),
    ],
)
def test_configurations_are_checked(make, message):
    with pytest.raises(ValueError, match=message):
        make()
