"""The safety case: what may harm, what is done about it, which test shows it, what nobody has seen.

Each hazard names its tests, and the faults and deeds whose measured times belong to it; a test
holds that they exist, and that the published times keep the bound.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["HAZARDS", "ZERO_WITHIN_S", "Hazard"]

ZERO_WITHIN_S = 0.3
"""From the moment at which the link allows it, the robot is told zero within this [s]."""


@dataclass(frozen=True, kw_only=True)
class Hazard:
    """One line of the safety case.

    Attributes:
        hazard: What may happen.
        measure: What is done about it.
        tests: `file::function` below `tests/`, which show that.
        deeds: Of `cpl.robot.trials.DEEDS`: what was done to real processes.
        faults: Of `cpl.robot.drill.WHAT`: what happened in lock-step.
        metres: How far the robot may go where no time bounds it [m]; None where one does.
        unverified: What remains for somebody with a robot.
    """

    hazard: str
    measure: str
    tests: tuple[str, ...]
    deeds: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    metres: float | None = None
    unverified: str = "that a Go1 stops when it is told zero, and how far it rolls on"


HAZARDS: tuple[Hazard, ...] = (
    Hazard(
        hazard="the policy dies, raises, hangs, or goes on after a pause",
        measure="an order holds for 0.2 s from when it was decided, by the watchdog's clock",
        tests=(
            "robot/test_live.py::test_every_exit_ends_in_zero_and_then_in_standing",
            "robot/test_lease.py::test_nothing_moves_without_a_fresh_order",
        ),
        deeds=("policy_killed", "policy_hung", "policy_continued"),
        faults=("exception", "hung", "slow_policy"),
    ),
    Hazard(
        hazard="the watchdog dies, hangs or is starved",
        measure="its second kills it, takes its port and stops the robot",
        tests=(
            "robot/test_second.py::test_a_silent_watchdog_is_gone_and_one_that_left_is_not",
            "robot/test_live.py::test_a_hung_watchdog_is_killed_and_its_second_stops_the_robot",
        ),
        deeds=("watchdog_killed", "watchdog_hung", "watchdog_starved"),
    ),
    Hazard(
        hazard="the second dies or hangs",
        measure="the watchdog ends the run, and kills a second that hangs",
        tests=("robot/test_live.py::test_every_exit_ends_in_zero_and_then_in_standing",),
        deeds=("second_killed", "second_hung"),
    ),
    Hazard(
        hazard="two of the three die or hang at once",
        measure="whoever is left stops the robot",
        tests=(
            "robot/test_live.py"
            "::test_policy_and_watchdog_killed_leave_a_second_that_stops_the_robot",
            "robot/test_live.py"
            "::test_watchdog_and_second_that_hang_leave_a_policy_that_stops_the_robot",
        ),
        deeds=("both_killed",),
        unverified="all three at once, as when the laptop crashes: the watchdog belongs on the "
        "robot's own computer then",
    ),
    Hazard(
        hazard="the computer sleeps and wakes up",
        measure="time goes on in suspend, so orders from before are old",
        tests=(
            "robot/test_live.py::test_a_computer_that_slept_wakes_up_to_a_robot_that_is_told_zero",
            "robot/test_lease.py"
            "::test_an_order_is_as_old_as_what_it_rests_on_and_not_as_its_arrival",
        ),
        deeds=("suspended",),
        faults=("suspended",),
        unverified="a real suspend; while the laptop sleeps only a watchdog on the robot helps",
    ),
    Hazard(
        hazard="the link goes and comes",
        measure="no error of a socket ends the watchdog; without an answer it asks for zero, for "
        "up to a minute after the run",
        tests=(
            "robot/test_live.py::test_a_link_that_goes_and_comes_is_no_end_of_the_watchdog",
            "robot/test_lease.py"
            "::test_zero_is_asked_for_while_the_robot_does_not_answer_and_then_it_is_over",
        ),
        deeds=("link_flaps",),
        faults=("flapping", "cut", "corrupted", "late"),
        unverified="a link that is cut for good, the watchdog on the laptop: remote, tether",
    ),
    Hazard(
        hazard="the robot answers nonsense, or not at all",
        measure="damaged states are none; without one for 0.25 s zero, for 1 s the end",
        tests=("robot/test_wire.py::test_fuzzed_answers_neither_crash_nor_become_a_state",),
        faults=("firmware", "babble"),
    ),
    Hazard(
        hazard="the network loses, repeats or mixes datagrams",
        measure="orders are sealed, numbered, and taken in order only",
        tests=("robot/test_lease.py::test_orders_are_obeyed_in_order_only",),
        faults=("dropped", "duplicated", "replayed", "reordered"),
    ),
    Hazard(
        hazard="poses stop, freeze, are damaged or come late",
        measure="a pose is as old as its camera's clock says; 0.15 s is too old",
        tests=(
            "robot/test_packets.py::test_a_pose_that_waited_is_as_old_as_its_camera_says",
            "robot/test_camera_clock.py::test_a_queue_that_fills_up_shows",
        ),
        faults=("lost", "frozen", "camera_corrupted", "camera_late", "camera_queue"),
        unverified="a physical T265, its clock and its queue",
    ),
    Hazard(
        hazard="poses become late little by little, or were from the start",
        measure="the same clock; and the legs, which know better",
        tests=(
            "robot/test_loop.py::test_poses_that_are_late_from_the_start_show_in_the_odometry",
            "robot/test_camera_clock.py::test_a_clock_that_drifts_or_is_set_is_a_fault",
        ),
        faults=("camera_drags", "camera_fast"),
        metres=1.0,
        unverified="a physical T265, its clock and its queue",
    ),
    Hazard(
        hazard="the camera counts from another origin, or jumps",
        measure="starts are counted; camera and legs are compared; either one is fenced",
        tests=(
            "robot/test_loop.py::test_a_camera_with_another_origin_never_ends_in_arrived",
            "robot/test_packets.py::test_a_new_bridge_is_heard_before_a_run_and_is_a_fault_in_it",
        ),
        faults=("camera_replugged", "camera_moved", "camera_set", "jump", "outside"),
    ),
    Hazard(
        hazard="the odometry is wrong, or the tracker has lost itself",
        measure="the gate between camera and legs; a tracker that fails for 0.5 s is lost",
        tests=(
            "robot/test_agreement.py::test_two_places_that_part_stay_parted",
            "robot/test_guard.py::test_what_ends_a_run_is_named_and_latched",
        ),
        faults=("odometry_drifts", "odometry_frozen", "failed"),
        metres=1.0,
        unverified="how well a Go1 counts its steps; the limits are from the twins' logs",
    ),
    Hazard(
        hazard="a stranger sends orders, or floods the port",
        measure="a key of this run that stands nowhere to be read; sender and run are pinned",
        tests=(
            "robot/test_live.py::test_a_watchdog_obeys_one_policy_with_the_key_and_nobody_else",
            "robot/test_loop.py::test_a_stranger_without_the_key_changes_nothing",
            "faults/test_faults_table.py::test_nothing_is_wrong_and_silent",
        ),
        faults=("orders_forged", "orders_replayed", "orders_flood"),
        unverified="somebody who has your user's rights, or root's",
    ),
    Hazard(
        hazard="a stranger sends poses",
        measure="the bridge's packets are sealed, its address is pinned",
        tests=(
            "robot/test_packets.py::test_after_the_anchor_nobody_else_is_heard",
            "robot/test_packets.py::test_a_packet_from_the_future_or_of_another_key_moves_nothing",
        ),
        faults=("poses_forged",),
        unverified="somebody who has your user's rights, or root's",
    ),
    Hazard(
        hazard="a key is read by others",
        measure="it goes over a pipe, or lies in a file of mode 600; nothing has a default",
        tests=(
            "robot/test_seal.py::test_a_key_file_is_for_its_owner_alone",
            "robot/test_live.py::test_a_watchdog_without_a_key_of_its_own_does_not_begin",
        ),
        unverified="the copy to the robot's computer, which is yours to make",
    ),
    Hazard(
        hazard="the computer's clock jumps",
        measure="a clock that nobody can set; a step that took too long ends the run",
        tests=("robot/test_lease.py::test_a_clock_that_runs_backwards_ends_it",),
        faults=("clock_forward", "clock_back"),
    ),
    Hazard(
        hazard="a velocity is too large, or no number",
        measure="the clamp, proved; rounding is toward zero",
        tests=(
            "robot/test_certificates.py::test_every_proof_goes_through",
            "robot/test_guard.py::test_a_clamped_velocity_is_inside_to_the_last_bit",
        ),
        faults=("no_number",),
    ),
    Hazard(
        hazard="somebody wants it to stop",
        measure="Enter, Ctrl-C, the remote, the battery: each is latched",
        tests=("robot/test_guard.py::test_what_ends_a_run_is_named_and_latched",),
        faults=("operator", "damped", "battery"),
        unverified="the remote's damping, which is the robot's own",
    ),
    Hazard(
        hazard="a run costs a log",
        measure="refused before anything moves; a full disk ends the run and not the log",
        tests=(
            "robot/test_loop.py::test_a_second_run_into_a_folder_refuses_before_anything_moves",
            "robot/test_command.py::test_a_second_run_at_a_terminal_touches_nothing",
            "robot/test_loop.py::test_a_full_disk_costs_the_run_but_not_what_was_written",
        ),
        faults=("disk_full",),
        unverified="a disk that lies about having written",
    ),
)
"""The lines, in the order in which the page shows them."""
